"""Read and write observations of E1 tracking in files of several formats."""
