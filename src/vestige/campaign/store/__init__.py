"""Store the results of campaigns on disk, and read stored results."""
