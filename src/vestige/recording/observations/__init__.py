"""What E1 tracking said, in files of several kinds."""
