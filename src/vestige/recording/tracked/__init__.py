"""What tracking makes of a recording: observations, navigation pages, ephemerides."""
