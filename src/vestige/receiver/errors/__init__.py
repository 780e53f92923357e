"""Model the errors of the receiver, with one file for each model."""
