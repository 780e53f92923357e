"""The command line: a file for each verb; no numeric module is imported before a command runs."""
