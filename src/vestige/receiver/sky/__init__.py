"""Compute the positions of satellites and receiver, and the receiver's view of each satellite."""
