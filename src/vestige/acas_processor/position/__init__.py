"""Ranges in use, position, and the errors of both."""
