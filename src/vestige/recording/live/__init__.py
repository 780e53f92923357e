"""Read recordings that grow during the processing."""
