"""Make snapshots of the simulated receiver for the processor from the truth of a block of epochs."""
