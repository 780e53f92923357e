"""What the simulated receiver hands to the processor, made from the truth of a block of epochs."""
