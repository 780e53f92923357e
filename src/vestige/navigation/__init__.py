"""Positions of satellites and receiver: broadcast orbits and clocks, position fix, RAIM."""
