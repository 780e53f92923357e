"""Products of tracking a recording: observations, navigation pages, ephemerides."""
