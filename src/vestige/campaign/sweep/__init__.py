"""Run one campaign for each combination of values of some settings."""
