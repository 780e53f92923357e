"""Navigation messages of the satellites: pages made from ephemerides and a source of OSNMA."""
