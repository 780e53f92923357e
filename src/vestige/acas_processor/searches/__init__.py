"""The searches for vestigial signals, and the rule that says when a search is due."""
