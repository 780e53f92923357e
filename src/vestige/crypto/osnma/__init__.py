"""Validate the keys of OSNMA, and verify the tags of OSNMA, in the pages of the navigation message."""
