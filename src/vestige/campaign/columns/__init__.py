"""Columns of the results of a campaign."""
