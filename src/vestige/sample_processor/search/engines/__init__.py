"""Engines of the exhaustive search: each computes the powers that the search compares with its threshold."""
