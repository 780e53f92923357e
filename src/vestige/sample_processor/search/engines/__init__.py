"""Engines of the exhaustive search: ways to compute the powers that are screened."""
