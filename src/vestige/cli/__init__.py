"""The command line of vestige, with a file for each verb. No numeric module is imported before a command runs."""
