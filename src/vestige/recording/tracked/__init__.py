"""Track E1 in a recording, and store observations, navigation pages and ephemerides."""
