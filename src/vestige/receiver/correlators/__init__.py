"""Draw correlators and search results from models, without samples."""
