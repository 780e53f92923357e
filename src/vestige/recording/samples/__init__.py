"""Files and streams of samples."""
