"""Files that the service (ACAS or SAS) publishes: RECS, group delays, signatures."""
