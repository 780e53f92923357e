"""Ranges in use and position, with their errors."""
