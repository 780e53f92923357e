"""Compute thresholds, losses, thermal noise and numbers of hypotheses from theory, and compare them with [WFO]."""
