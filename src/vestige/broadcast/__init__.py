"""What satellites send: the pages of each satellite, made of its ephemerides and an OSNMA source."""
