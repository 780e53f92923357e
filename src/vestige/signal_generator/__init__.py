"""Simulate the signals of satellites as continuous functions of time [WFO, Sec. V]."""
