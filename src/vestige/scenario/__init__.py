"""Read scenario files, which describe a simulation in TOML.

An unknown key is an error, and the message names the position of the key in the file. Many tables of a file directly
configure a model of `vestige.receiver` or `vestige.signal_generator`. The key `kind` of a file tells whether the
scenario is a campaign or a recording.
"""
