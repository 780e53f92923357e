"""The simulated receiver: front end, sampling, and the files that a capture would leave [WFO, Sec. V]."""
