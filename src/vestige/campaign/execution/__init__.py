"""Where the epochs of a campaign are computed."""
