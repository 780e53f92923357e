"""The command line has a file for each verb. No numeric module is imported before a command runs."""
