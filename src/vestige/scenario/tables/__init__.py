"""Define the tables that a scenario file of a campaign may contain."""
