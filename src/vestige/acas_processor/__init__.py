"""ACAS processing [WFO, Sec. III and IV]: hand-over, thresholds, detectors, range offset, mitigation, verdicts."""
