"""Commands for recordings that are still being written, and for samples out of a pipe."""
