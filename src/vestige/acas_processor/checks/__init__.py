"""Compare statistics of the measurements with thresholds, most of which follow from a false-alarm budget."""
