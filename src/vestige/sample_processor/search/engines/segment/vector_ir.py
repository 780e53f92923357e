"""Vector instructions for the segment engine, written as LLVM code: sums of rows of bytes, and DFTs of float32 lanes.

numba vectorises simple loops, but it cannot keep eight vectors in registers over a loop, nor unroll a DFT whose lanes
are search offsets. So three short pieces are emitted here as intrinsics; LLVM legalises the vectors for AVX-512, AVX2
or NEON. In a DFT one lane is one offset, `LANES` at a time; a `None` stands for a number that is known to be zero, and
outputs that nobody asks for vanish as dead code.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
# ruff: noqa: ARG001  (an intrinsic types its arguments in one function and uses them in another)

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.errors import TypingError
from numba.extending import intrinsic

LANES = 16  # float32 numbers of a vector of 512 bit
SUM_WIDTH = 512  # offsets that `signed_row_sum` adds at once: eight vectors of bytes, sixteen of int16
DFT_POINTS = 16  # of one DFT

_BYTES = ir.VectorType(ir.IntType(8), 64)
_INT16 = ir.VectorType(ir.IntType(16), 32)
_SHORT = ir.VectorType(ir.IntType(16), LANES)
_FLOAT = ir.VectorType(ir.FloatType(), LANES)
_FLAGS = ("contract",)  # a product and a sum may become one instruction


class _Lanes:
    """Sees to loads and stores at an element of a numba array."""

    def __init__(self, context, builder, array_type, array):
        self.builder = builder
        self.data = context.make_array(array_type)(context, builder, array).data

    def at(self, index, vector):
        return self.builder.bitcast(self.builder.gep(self.data, [index]), vector.as_pointer())

    def load(self, index, vector, align):
        return self.builder.load(self.at(index, vector), align=align)

    def store(self, value, index, align):
        self.builder.store(value, self.at(index, value.type), align=align)


class _Complex:
    """A complex number in lanes; `None` for a part means zero."""

    def __init__(self, builder, re, im):
        self.builder, self.re, self.im = builder, re, im

    def _part(self, a, b, sign):
        if b is None:
            return a
        if a is None:
            return b if sign > 0 else self.builder.fneg(b)
        return (self.builder.fadd if sign > 0 else self.builder.fsub)(a, b, flags=_FLAGS)

    def __add__(self, other):
        return _Complex(self.builder, self._part(self.re, other.re, 1), self._part(self.im, other.im, 1))

    def __sub__(self, other):
        return _Complex(self.builder, self._part(self.re, other.re, -1), self._part(self.im, other.im, -1))

    def _times(self, a, factor):
        return None if a is None else self.builder.fmul(a, factor, flags=_FLAGS)

    def turned(self, k, n):
        """Return the number times exp(−j2πk/n)."""
        k %= n
        if k == 0:
            return self
        if 4 * k == n:  # −j
            return _Complex(self.builder, self.im, self._part(None, self.re, -1))
        w = np.exp(-2j * np.pi * k / n)
        return self.times(_constant(w.real), _constant(w.imag))

    def times(self, w_re, w_im):
        """Return the number times a complex number in lanes."""
        re = self._part(self._times(self.re, w_re), self._times(self.im, w_im), -1)
        im = self._part(self._times(self.re, w_im), self._times(self.im, w_re), 1)
        return _Complex(self.builder, re, im)


def _constant(value):
    return ir.Constant(_FLOAT, [float(np.float32(value))] * LANES)


def _dft(x):
    """Return Σ_j x_j exp(−j2πjk/n) for k = 0 … n−1, by decimation in frequency."""
    n = len(x)
    if n == 1:
        return x
    half = n // 2
    even = _dft([x[i] + x[i + half] for i in range(half)])
    odd = _dft([(x[i] - x[i + half]).turned(i, n) for i in range(half)])
    return [value for pair in zip(even, odd, strict=True) for value in pair]


def _splat(builder, value, vector):
    one = builder.insert_element(ir.Constant(vector, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    mask = ir.Constant(ir.VectorType(ir.IntType(32), vector.count), [0] * vector.count)
    return builder.shuffle_vector(one, ir.Constant(vector, ir.Undefined), mask)


def _literal(value):
    if not isinstance(value, types.IntegerLiteral):
        raise TypingError("a shape of the DFT must be a literal")
    return value.literal_value


@intrinsic
def signed_row_sum(typing_context, table, entries, first, middle, last, zero, base, out, out_index):
    """Store SUM_WIDTH sums of table[entry + base + i] at `out[out_index:]`: entries first … middle less the rest.

    `zero` is taken off each sum. The rows are bytes up to 127, and entries come in pairs, so a pair of rows is added
    byte by byte; then all odd bytes and all 16-bit words are summed, and Σ even = Σ words − 256 Σ odd, modulo 2¹⁶.
    Of 64 sums in a row the 32 of even i are stored first, then those of odd i.
    """

    def codegen(context, builder, signature, arguments):
        n_table, n_entries, low, mid, high, zero, start, n_out, where = arguments
        source = _Lanes(context, builder, signature.args[0], n_table)
        entry = _Lanes(context, builder, signature.args[1], n_entries)
        target = _Lanes(context, builder, signature.args[7], n_out)
        width = _BYTES.count
        eight = ir.Constant(_INT16, [8] * _INT16.count)
        less = builder.neg(builder.trunc(zero, ir.IntType(16)))
        odd_less = _splat(builder, less, _INT16)
        word_less = _splat(builder, builder.mul(less, ir.Constant(less.type, 257)), _INT16)
        words = [cgutils.alloca_once_value(builder, word_less) for _ in range(SUM_WIDTH // width)]
        odds = [cgutils.alloca_once_value(builder, odd_less) for _ in words]
        for begin, end, combine in ((low, mid, builder.add), (mid, high, builder.sub)):
            with cgutils.for_range_slice(builder, begin, end, ir.Constant(begin.type, 2)) as (i, _):
                places = []
                for k in (0, 1):
                    index = builder.add(i, ir.Constant(i.type, k))
                    offset = builder.sext(builder.load(builder.gep(entry.data, [index])), ir.IntType(64))
                    places.append(builder.add(offset, start))
                for v, (word, odd) in enumerate(zip(words, odds, strict=True)):
                    shift = ir.Constant(start.type, v * width)
                    rows = [source.load(builder.add(place, shift), _BYTES, 1) for place in places]
                    pair = builder.bitcast(builder.add(*rows), _INT16)
                    builder.store(combine(builder.load(word), pair), word)
                    builder.store(combine(builder.load(odd), builder.lshr(pair, eight)), odd)
        for v, (word, odd) in enumerate(zip(words, odds, strict=True)):
            place = builder.add(where, ir.Constant(where.type, v * width))
            odd_sum = builder.load(odd)
            target.store(builder.sub(builder.load(word), builder.shl(odd_sum, eight)), place, 2)
            target.store(odd_sum, builder.add(place, ir.Constant(place.type, _INT16.count)), 2)
        return context.get_dummy_value()

    i64 = types.int64
    return types.void(table, entries, i64, i64, i64, i64, i64, out, i64), codegen


@intrinsic
def first_dft(typing_context, sums_re, sums_im, index, step, n_inputs, turns, turn_index, out, out_index):
    """Store the turned DFT over 16 points, of which the first `n_inputs` are not zero.

    Input j is int16 lanes at `index + j · step`; output r, times turns[turn_index + 2r] + j turns[turn_index + 2r + 1],
    goes to `out[out_index + r · POINTS · 2 · LANES]`, imaginary part LANES later.
    """
    count = _literal(n_inputs)

    def codegen(context, builder, signature, arguments):
        re, im, first, stride, _, factors, turn, target, where = arguments
        parts = [_Lanes(context, builder, signature.args[k], part) for k, part in enumerate((re, im))]
        factor = _Lanes(context, builder, signature.args[5], factors)
        out_lanes = _Lanes(context, builder, signature.args[7], target)
        zero = _Complex(builder, None, None)
        x = [zero] * DFT_POINTS
        for j in range(count):
            place = builder.add(first, builder.mul(stride, ir.Constant(stride.type, j)))
            x[j] = _Complex(builder, *(builder.sitofp(part.load(place, _SHORT, 2), _FLOAT) for part in parts))
        for r, y in enumerate(_dft(x)):
            w = [
                _splat(
                    builder,
                    builder.load(builder.gep(factor.data, [builder.add(turn, ir.Constant(turn.type, k))])),
                    _FLOAT,
                )
                for k in (2 * r, 2 * r + 1)
            ]
            z = y.times(*w)
            place = builder.add(where, ir.Constant(where.type, r * DFT_POINTS * 2 * LANES))
            out_lanes.store(z.re, place, 4)
            out_lanes.store(z.im, builder.add(place, ir.Constant(place.type, LANES)), 4)
        return context.get_dummy_value()

    i64 = types.int64
    signature = types.void(sums_re, sums_im, i64, i64, n_inputs, turns, i64, out, i64)
    return signature, codegen


def _second(context, builder, signature, arguments, low, high):
    """Return the DFT outputs low … high (negative ones count from the end) of 16 points at `index`."""
    lanes = _Lanes(context, builder, signature.args[0], arguments[0])
    x = []
    for b in range(DFT_POINTS):
        place = builder.add(arguments[1], ir.Constant(arguments[1].type, b * 2 * LANES))
        im = builder.add(place, ir.Constant(place.type, LANES))
        x.append(_Complex(builder, lanes.load(place, _FLOAT, 4), lanes.load(im, _FLOAT, 4)))
    z = _dft(x)
    return [z[g % DFT_POINTS] for g in range(low, high + 1)]


@intrinsic
def second_dft_maximum(typing_context, points, index, low, high, out, out_index):
    """Raise `out[out_index:]` to the powers of the DFT outputs low … high where they are larger."""
    first, last = _literal(low), _literal(high)

    def codegen(context, builder, signature, arguments):
        target = _Lanes(context, builder, signature.args[4], arguments[4])
        best = target.load(arguments[5], _FLOAT, 4)
        for z in _second(context, builder, signature, arguments, first, last):
            square = builder.fmul(z.re, z.re, flags=_FLAGS)
            power = builder.fadd(square, builder.fmul(z.im, z.im, flags=_FLAGS), flags=_FLAGS)
            best = builder.select(builder.fcmp_ordered(">", power, best), power, best)
        target.store(best, arguments[5], 4)
        return context.get_dummy_value()

    return types.void(points, types.int64, low, high, out, types.int64), codegen


@intrinsic
def second_dft_store(typing_context, points, index, low, high, out, out_index, bin_stride, part_stride):
    """Store the DFT outputs low … high at `out[out_index + (g − low) · bin_stride]`, imaginary part a part later."""
    first, last = _literal(low), _literal(high)

    def codegen(context, builder, signature, arguments):
        target = _Lanes(context, builder, signature.args[4], arguments[4])
        place = arguments[5]
        for z in _second(context, builder, signature, arguments, first, last):
            target.store(z.re, place, 4)
            target.store(z.im, builder.add(place, arguments[7]), 4)
            place = builder.add(place, arguments[6])
        return context.get_dummy_value()

    i64 = types.int64
    return types.void(points, i64, low, high, out, i64, i64, i64), codegen
