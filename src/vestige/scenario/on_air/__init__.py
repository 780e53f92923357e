"""Tables of what the satellites of a sky broadcast, and of what the atmosphere does to it."""
