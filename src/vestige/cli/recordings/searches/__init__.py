"""Define the command `vestige search`, with its options, input, printed report and figures."""
