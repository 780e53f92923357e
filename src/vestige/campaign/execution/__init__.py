"""Compute the epochs of a campaign with threads, with processes, or on a cluster."""
