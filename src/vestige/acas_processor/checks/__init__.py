"""Checks: each compares one statistic with a threshold that follows from its false-alarm budget."""
