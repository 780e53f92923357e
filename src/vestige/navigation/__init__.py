"""Where satellites and receiver are: broadcast orbits and clocks, position fix, receiver autonomous integrity."""
