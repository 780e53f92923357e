"""Read navigation data: ephemerides and I/NAV pages."""
