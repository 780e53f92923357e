"""Scenario tables for the broadcast of the satellites, and for its delay in the atmosphere."""
