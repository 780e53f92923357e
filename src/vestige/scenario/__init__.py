"""Read scenario files, which describe a simulation in TOML.

An unknown key is an error, and the message names the position of the key in the file. A file configures the models of
`vestige.receiver` and `vestige.signal_generator` directly, without a second set of classes. The key `kind` of a file
tells whether the scenario is a campaign or a recording.
"""
