"""Define the command line of vestige, with a file for each command.

No numeric module is imported before a command runs.
"""
