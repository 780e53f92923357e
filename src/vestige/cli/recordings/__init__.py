"""Define the commands for recordings."""
