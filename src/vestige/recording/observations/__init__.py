"""Observations of E1 tracking, in files of several formats."""
