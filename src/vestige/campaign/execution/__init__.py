"""Executors of a campaign: threads, processes or a cluster that compute its epochs."""
