"""Make the samples of both bands, around RECS or as a continuous stream."""
