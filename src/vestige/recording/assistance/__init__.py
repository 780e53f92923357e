"""Read and write the assistance folder: RECS, group delays, keys."""
