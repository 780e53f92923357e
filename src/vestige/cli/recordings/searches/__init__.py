"""`vestige search`: its options, input, printed report and figures."""
