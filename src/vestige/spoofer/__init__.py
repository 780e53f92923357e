"""The attacker: profiles against time, attacks, and what they put into the victim's antenna [WFO, Sec. V]."""
