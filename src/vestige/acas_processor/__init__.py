"""Process snapshots with ACAS [WFO, Sec. III and IV]: hand-over, detection, range offset, checks and verdicts."""
