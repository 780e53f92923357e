"""Run campaigns: measure many epochs in chunks on several workers, store the results, and compute statistics."""
