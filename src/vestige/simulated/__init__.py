"""Simulate what a scenario describes: snapshots, recordings and exported test cases."""
