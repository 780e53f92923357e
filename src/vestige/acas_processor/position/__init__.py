"""Choose the ranges in use, and compute the position of the receiver and the errors of the position."""
