"""Compute the powers that the exhaustive search compares with a threshold, by engines for a processor or a GPU."""
