"""OSNMA: validate the keys and verify the tags in the pages of the navigation message."""
