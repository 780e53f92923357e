"""Define the commands for new users, `vestige demo` and `vestige init`."""
