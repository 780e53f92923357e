"""Track E1 with loops that follow code and carrier of each satellite, and read the message of the satellite."""
