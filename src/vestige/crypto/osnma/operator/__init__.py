"""The operator's side of OSNMA: signs root keys, discloses TESLA keys and makes tags, for skies that are simulated."""
