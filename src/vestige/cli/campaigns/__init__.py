"""Define the commands for campaigns."""
