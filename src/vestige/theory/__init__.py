"""Theory of the receiver: thresholds, losses, thermal noise, numbers of hypotheses, and the numbers of the paper."""
