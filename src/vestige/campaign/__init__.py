"""Campaigns: workers measure many epochs in chunks, a store keeps the results, and statistics count them."""
