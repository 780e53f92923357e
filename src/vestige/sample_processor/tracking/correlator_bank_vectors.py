"""Compute the sums of the correlator bank with vector instructions, which are written as LLVM code.

`vestige.sample_processor.tracking.correlator_bank_kernel` explains the computation. A vector has four lanes: the real
and imaginary parts of the sums at two consecutive lags.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
# ruff: noqa: ARG001  (an intrinsic declares its arguments in one function and uses them in another)

from __future__ import annotations

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from vestige.vector_code import Lanes, splat

VECTORS = 3  # number of vectors of the pilot in a call; each vector contains two consecutive lags
DATA_VECTOR = 1  # index of the vector whose first lag gives the correlator of the data signal
SUMS = 4 * 2 * (VECTORS + 1)  # count of the numbers that `bank_sums` stores
_INDEX = ir.IntType(64)
_VECTOR = ir.VectorType(ir.FloatType(), 4)
_FLAGS = ("contract",)  # LLVM may fuse a product and a sum into a single instruction


@intrinsic
def bank_sums(typing_context, running, edges, replicas, replica_at, carrier, first, end, starts, starts_at, out):
    """Store the correlations with the replicas of pilot and data signal over the segments j = first … end − 1.

    The samples of segment j, moved by l samples, have the sum D(l) = running[edges[j + 1] + l] − running[edges[j] + l].
    `running` contains the running sums as pairs of a real and an imaginary part. Vector v contains D at l =
    starts[starts_at + v] and at l + 1. In segment j, the replicas have the values replicas[0, replica_at + j] (pilot)
    and replicas[1, replica_at + j] (data signal). The carrier has the cosine carrier[0, j] and the sine carrier[1, j].
    `out` gets eight numbers for each vector of the pilot and for `DATA_VECTOR` of the data signal. Four numbers are
    sums of D × replica × cosine, and four numbers are sums of D × replica × sine. All sums with the cosine come first,
    then all sums with the sine.
    """

    def codegen(context, builder, signature, arguments):
        n_running, n_edges, n_replicas, segment_at, n_carrier, begin, stop, n_starts, vector_at, n_out = arguments
        sums = Lanes(context, builder, signature.args[0], n_running)
        edge = Lanes(context, builder, signature.args[1], n_edges)
        first_lag = Lanes(context, builder, signature.args[7], n_starts)
        target = Lanes(context, builder, signature.args[9], n_out)
        signals = _rows(context, builder, signature.args[2], n_replicas)
        cos_sin = _rows(context, builder, signature.args[4], n_carrier)
        first_lags = [first_lag.number(builder.add(vector_at, _INDEX(v))) for v in range(VECTORS)]

        def running_sums(j):
            at = builder.sext(edge.number(j), _INDEX)
            return [sums.load(builder.shl(builder.add(at, lag), _INDEX(1)), _VECTOR, 4) for lag in first_lags]

        def add(total, product):
            builder.store(builder.fadd(builder.load(total), product, flags=_FLAGS), total)

        nothing = ir.Constant(_VECTOR, [0.0] * _VECTOR.count)
        totals = [[cgutils.alloca_once_value(builder, nothing) for _ in range(VECTORS + 1)] for _ in cos_sin]
        before = [cgutils.alloca_once_value(builder, value) for value in running_sums(begin)]
        with cgutils.for_range_slice(builder, begin, stop, _INDEX(1)) as (j, _):
            turns = [splat(builder, part.number(j), _VECTOR) for part in cos_sin]
            pilot, data = (splat(builder, one.number(builder.add(segment_at, j)), _VECTOR) for one in signals)
            differences = []
            for value, old in zip(running_sums(builder.add(j, _INDEX(1))), before, strict=True):
                differences.append(builder.fsub(value, builder.load(old), flags=_FLAGS))
                builder.store(value, old)
            products = [builder.fmul(one, pilot, flags=_FLAGS) for one in differences]
            products.append(builder.fmul(differences[DATA_VECTOR], data, flags=_FLAGS))
            for turn, row in zip(turns, totals, strict=True):
                for product, total in zip(products, row, strict=True):
                    add(total, builder.fmul(product, turn, flags=_FLAGS))
        for number, total in enumerate(total for row in totals for total in row):
            target.store(builder.load(total), _INDEX(4 * number), 4)
        return context.get_dummy_value()

    i64 = types.int64
    return types.void(running, edges, replicas, i64, carrier, i64, i64, starts, i64, out), codegen


def _rows(context, builder, array_type, array):
    """Return a `Lanes` object for each of the two rows of an array."""
    length = builder.extract_value(context.make_array(array_type)(context, builder, array).shape, 1)
    rows = [Lanes(context, builder, array_type, array) for _ in range(2)]
    rows[1].data = builder.gep(rows[1].data, [length])
    return rows
