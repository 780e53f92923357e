"""Check received power, noise floor, C/N0, and the strength of the encrypted signal."""
