"""Compute positions of satellites and receiver, and check pseudoranges by RAIM."""
