"""Write the outputs of `vestige process` and `vestige live` for other programs."""
