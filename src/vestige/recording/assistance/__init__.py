"""The assistance folder: RECS, group delays, keys."""
