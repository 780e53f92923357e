"""Front ends and streams of samples of both bands."""
