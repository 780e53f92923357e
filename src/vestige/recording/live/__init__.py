"""Recordings that grow while they are processed."""
