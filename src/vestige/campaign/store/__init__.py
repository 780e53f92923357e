"""Results of campaigns on disk."""
