"""Define and compute the columns in the results of a campaign."""
