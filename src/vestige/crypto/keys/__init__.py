"""Read, write and verify public keys, their Merkle tree, and files of validated keys."""
