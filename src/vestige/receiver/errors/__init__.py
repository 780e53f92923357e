"""The error models of the receiver, one file each."""
