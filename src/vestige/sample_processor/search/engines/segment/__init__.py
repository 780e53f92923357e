"""The int8 engine: sums from tables of signs, in instructions written for LLVM."""
