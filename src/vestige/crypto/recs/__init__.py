"""Read, write and verify the files that the service (ACAS or SAS) publishes: RECS, group delays, signatures."""
