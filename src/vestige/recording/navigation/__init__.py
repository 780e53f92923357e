"""Navigation data: ephemerides and I/NAV pages."""
