"""Provide tools for kernels whose inner loop is written as LLVM code.

numba vectorises simple loops, but cannot keep several vectors in registers during a loop.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

from llvmlite import ir


class Lanes:
    """Access to the elements of a numba array, for LLVM code that loads and stores vectors or numbers."""

    def __init__(self, context, builder, array_type, array):
        self.builder = builder
        self.data = context.make_array(array_type)(context, builder, array).data

    def at(self, index, vector):
        """Return the address of the vector that begins at the element `index`."""
        return self.builder.bitcast(self.builder.gep(self.data, [index]), vector.as_pointer())

    def load(self, index, vector, align):
        """Return the vector that begins at the element `index`; `align` is the alignment of the address in bytes."""
        return self.builder.load(self.at(index, vector), align=align)

    def store(self, value, index, align):
        """Store a vector from the element `index` on; `align` is the alignment of the address in bytes."""
        self.builder.store(value, self.at(index, value.type), align=align)

    def number(self, index):
        """Return the number in the element `index`."""
        return self.builder.load(self.builder.gep(self.data, [index]))


def splat(builder, value, vector):
    """Return a vector that has `value` in every lane."""
    one = builder.insert_element(ir.Constant(vector, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    mask = ir.Constant(ir.VectorType(ir.IntType(32), vector.count), [0] * vector.count)
    return builder.shuffle_vector(one, ir.Constant(vector, ir.Undefined), mask)
