"""Search for vestigial signals: all signals of a satellite on E1, and the encrypted signal on E6 [WFO, Sec. III]."""
