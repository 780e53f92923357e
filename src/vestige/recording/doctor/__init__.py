"""What the signals in a recording say of its description."""
