"""The command line: one file a verb; nothing numeric is imported before a command runs."""
