"""Write positions and the receiver's integrity in formats that other programs read."""
