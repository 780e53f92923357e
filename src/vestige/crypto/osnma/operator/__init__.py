"""The OSNMA operator of simulated skies, which signs root keys, discloses TESLA keys and makes tags."""
