"""Simulate the attacker: profiles over time, attacks, and their signals at the victim's antenna [WFO, Sec. V]."""
