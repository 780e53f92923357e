"""File formats and cryptography of OSNMA messages, keys, RECS and group delays. The package does not read samples."""
