"""Simulate a receiver: front end, sampling, and the files that a real receiver would write [WFO, Sec. V]."""
