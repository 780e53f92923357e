"""Security code estimation and replay: the attacker's estimates, and the partial correlations that show them."""
