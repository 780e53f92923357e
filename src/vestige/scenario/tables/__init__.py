"""Tables of a campaign scenario."""
