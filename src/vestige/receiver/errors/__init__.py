"""The error models of the receiver, with one file for each model."""
