"""Commands for files of the services, and for theory."""
