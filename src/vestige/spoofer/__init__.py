"""The attacker: profiles against time, attacks, and their signals at the victim's antenna [WFO, Sec. V]."""
