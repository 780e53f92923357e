"""Theory of the receiver: thresholds, losses, thermal noise, numbers of hypotheses, and a comparison with the paper."""
