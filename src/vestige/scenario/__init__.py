"""Scenario files: TOML files that describe a simulation. Unknown keys are errors, with their position in the file.

A file configures the models of `vestige.receiver` and `vestige.signal_generator` directly, without a second set of
classes. The key `kind` of a file tells whether the scenario is a campaign or a recording.
"""
