"""Make the navigation messages of the satellites: pages from ephemerides and a source of OSNMA."""
