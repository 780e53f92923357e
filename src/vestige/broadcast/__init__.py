"""Navigation messages of the satellites: pages made of ephemerides and an OSNMA source."""
