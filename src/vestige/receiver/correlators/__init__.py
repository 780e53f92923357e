"""Draw correlators and search results from exact models, without samples."""
