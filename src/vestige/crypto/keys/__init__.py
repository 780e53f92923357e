"""Public keys, their Merkle tree, and files of validated keys."""
