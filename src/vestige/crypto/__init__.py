"""Read, write and verify OSNMA messages, keys, RECS and group delays; this package does not read samples."""
