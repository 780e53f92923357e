"""Codecs and cryptography of bytes: I/NAV pages, OSNMA keys, RECS, group delays. Other packages read samples."""
