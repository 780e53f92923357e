"""Define the Galileo signals: components, codes, chip pulses, spectra and correlation functions."""
