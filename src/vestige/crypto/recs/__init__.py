"""Files that the SAS service publishes: RECS, group delays, signatures."""
