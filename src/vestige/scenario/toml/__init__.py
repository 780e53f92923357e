"""Readers and writers of TOML."""
