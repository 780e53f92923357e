"""Bytes in, bytes out: I/NAV pages, OSNMA keys, RECS, group delays. Nothing here knows of samples."""
