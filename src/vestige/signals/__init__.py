"""Properties of the Galileo signals: definitions, codes, pulse, spectrum, autocorrelation."""
