"""Process samples of E1 and E6: acquisition, tracking, correlation, noise floor and searches [WFO, Sec. V]."""
