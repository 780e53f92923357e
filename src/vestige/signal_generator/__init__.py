"""The simulated signals as continuous functions of time [WFO, Sec. V]."""
