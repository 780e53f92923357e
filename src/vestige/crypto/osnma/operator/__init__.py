"""Simulate the OSNMA operator, which signs root keys, discloses TESLA keys and makes tags."""
