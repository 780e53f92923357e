"""Define the command for recordings that are still being written, and for samples from a pipe."""
