"""Draw figures of probabilities and of sweeps."""
