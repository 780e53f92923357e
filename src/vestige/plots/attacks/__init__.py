"""Draw figures of attacks."""
