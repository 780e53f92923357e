"""Formats of the OSNMA messages, and the verification of the messages."""
