"""Records of n epochs and m satellites: what crosses the border to the block processor."""
