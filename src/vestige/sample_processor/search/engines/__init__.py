"""Engines of the exhaustive search: each engine computes the powers that the search compares with a threshold."""
