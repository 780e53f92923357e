"""Define the commands for OSNMA, RECS and RINEX files, and for theory."""
