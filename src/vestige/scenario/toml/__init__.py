"""Read and write the TOML files of scenarios."""
