"""Vestigial signal searches: every signal of a satellite on E1, and the encrypted signal on E6 [WFO, Sec. III-D, E]."""
