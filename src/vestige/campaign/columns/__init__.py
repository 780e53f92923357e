"""The columns of the results."""
