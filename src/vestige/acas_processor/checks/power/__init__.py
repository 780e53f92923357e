"""Checks of power and of C/N0."""
