"""Correlators and search results, drawn from exact models without samples."""
