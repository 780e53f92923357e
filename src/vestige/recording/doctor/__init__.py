"""Examination of the signals in a recording, to find errors in its description."""
