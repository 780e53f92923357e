"""Checks of the processor: a check compares a statistic with a threshold that follows from a false-alarm budget."""
