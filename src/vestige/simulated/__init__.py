"""Simulate the snapshots, recordings and exported test cases that a scenario describes."""
