"""Theory of security code estimation and replay: the attacker's estimates, and their detection."""
