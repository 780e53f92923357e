"""Compare statistics of the measurements with thresholds that follow from a false-alarm budget."""
