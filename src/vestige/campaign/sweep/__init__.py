"""Campaigns over the values of some settings."""
