"""Figures of probabilities and of sweeps."""
