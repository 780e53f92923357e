"""Low-level signal processing: correlation, noise floor, acquisition [WFO, Sec. V]."""
