"""Search for vestigial signals, and decide when a search is due."""
