"""Compute how well an attacker estimates security codes, and how well a receiver detects the replay of estimates."""
