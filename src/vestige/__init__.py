"""vestige: Galileo ACAS / SAS signal authentication."""
