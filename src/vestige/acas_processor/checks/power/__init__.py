"""Check received power, distortion, noise floor, C/N0, and presence, strength and fading of the encrypted signal."""
