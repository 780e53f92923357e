"""Where satellites and receiver are, and how a satellite is seen."""
