"""Snapshots of the simulated receiver for the processor, made from the truth of a block of epochs."""
