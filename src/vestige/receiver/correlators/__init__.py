"""What correlators and searches give, drawn from exact models without samples."""
