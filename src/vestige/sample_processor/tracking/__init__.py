"""Tracking of E1: loops that follow code and carrier of each satellite, and the message of the satellite."""
