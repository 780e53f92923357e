"""Simulate the front end of a receiver: filter, gain control and quantiser, and the correlation behind the filter."""
