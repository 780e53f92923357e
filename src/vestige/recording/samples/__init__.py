"""Read and write files and streams of samples."""
