"""Examine the signals in a recording, to find errors in the description of the recording."""
