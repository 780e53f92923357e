"""Scenario files: TOML that says what is simulated. Unknown keys are errors, with their place in the file.

The models of `vestige.receiver` and `vestige.signal_generator` are what a file configures: there is no second set of
classes. A file's `kind` says which scenario it is.
"""
