"""Tables of the broadcast of a sky's satellites, and of its delay in the atmosphere."""
