"""Emit vector instructions for the segment engine as LLVM code: sums of rows of bytes, and DFTs over lanes.

numba cannot unroll a DFT whose lanes are search offsets. `vestige.vector_code` explains another limit of numba. So this
module emits the inner loops as intrinsics. LLVM adapts the vectors of the loops to AVX-512, AVX2 or NEON. In a DFT each
lane is a search offset. `None` stands for a number that is known to be zero. LLVM removes the outputs that are not
used. The same DFT runs on float32 and on int16 (`_Float`, `_Fixed`).
"""

# mypy: allow-untyped-defs, allow-untyped-calls
# ruff: noqa: ARG001  (an intrinsic declares its arguments in one function and uses them in another)

from __future__ import annotations

from functools import reduce

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.errors import TypingError
from numba.extending import intrinsic

from vestige.vector_code import Lanes, splat

LANES = 8  # number of float32 numbers in a vector of 256 bits
SHORT_LANES = 16  # number of int16 numbers in a vector of 256 bits
VECTOR_BYTES = 32  # number of bytes in a vector of 256 bits
ROWS_AT_ONCE = 8  # number of rows of five bits whose sum fits a byte
ROW_TOP = 31  # largest value of a byte in a row
SUM_WIDTH = 128  # number of offsets that `row_sum` sums at once: four vectors of bytes, or eight vectors of int16
DFT_POINTS = 16  # number of points of the second DFT; the first DFT has 16 or 8 points

_BYTE = ir.IntType(8)
_BYTES = ir.VectorType(_BYTE, VECTOR_BYTES)
_SHORT = ir.VectorType(ir.IntType(16), SHORT_LANES)
_WIDE = ir.VectorType(ir.IntType(32), SHORT_LANES)
_FLOAT = ir.VectorType(ir.FloatType(), LANES)
_FLAGS = ("contract",)  # LLVM may fuse a product and a sum into a single instruction


class _Float:
    """Arithmetic on float32 lanes."""

    vector, lanes, align = _FLOAT, LANES, 4

    def __init__(self, builder):
        self.builder = builder

    def plus(self, a, b):
        return self.builder.fadd(a, b, flags=_FLAGS)

    def minus(self, a, b):
        return self.builder.fsub(a, b, flags=_FLAGS)

    def negative(self, a):
        return self.builder.fneg(a)

    def times(self, a, b):
        return self.builder.fmul(a, b, flags=_FLAGS)

    def scaled(self, a, factor):
        return self.times(a, ir.Constant(_FLOAT, [float(np.float32(factor))] * LANES))

    def square(self, a):
        return self.times(a, a)

    def larger(self, a, b):
        return self.builder.select(self.builder.fcmp_ordered(">", a, b), a, b)

    def unbiased(self, a):
        return a

    def of_sum(self, lanes, place):
        return self.builder.sitofp(lanes.load(place, ir.VectorType(ir.IntType(16), LANES), 2), _FLOAT)


class _Fixed:
    """Arithmetic on int16 lanes. Sums wrap, so the caller limits the numbers. A factor is in units of 2⁻¹⁶."""

    vector, lanes, align = _SHORT, SHORT_LANES, 2

    def __init__(self, builder):
        self.builder = builder

    def plus(self, a, b):
        return self.builder.add(a, b)

    def minus(self, a, b):
        return self.builder.sub(a, b)

    def negative(self, a):
        return self.builder.neg(a)

    def times(self, a, b):
        product = self.builder.mul(self.builder.sext(a, _WIDE), self.builder.sext(b, _WIDE))
        return self.builder.trunc(self.builder.lshr(product, ir.Constant(_WIDE, [16] * SHORT_LANES)), _SHORT)

    def scaled(self, a, factor):
        whole = round(factor) if abs(factor) >= 0.5 else 0  # a factor of int16 lies within ±½
        rest = ir.Constant(_SHORT, [round((factor - whole) * 65536)] * SHORT_LANES)
        product = self.times(a, rest)
        return product if whole == 0 else (self.plus if whole > 0 else self.minus)(product, a)

    def square(self, a):
        kind = ir.FunctionType(_SHORT, [_SHORT, _SHORT])
        saturating = cgutils.get_or_insert_function(self.builder.module, kind, f"llvm.sadd.sat.v{SHORT_LANES}i16")
        twice = self.builder.call(saturating, [a, a])  # the number is doubled, so that the square has two more bits
        return self.times(twice, twice)

    def larger(self, a, b):
        return self.builder.select(self.builder.icmp_signed(">", a, b), a, b)

    def unbiased(self, a):
        """Return a sum of two products without its bias of −1; each product is rounded down by ½ on average."""
        return self.plus(a, ir.Constant(_SHORT, [1] * SHORT_LANES))

    def of_sum(self, lanes, place):
        return lanes.load(place, _SHORT, 2)


class _Complex:
    """A complex number in lanes; `None` for a part means zero."""

    def __init__(self, unit, re, im):
        self.unit, self.re, self.im = unit, re, im

    def _part(self, a, b, sign):
        if b is None:
            return a
        if a is None:
            return b if sign > 0 else self.unit.negative(b)
        return (self.unit.plus if sign > 0 else self.unit.minus)(a, b)

    def __add__(self, other):
        return _Complex(self.unit, self._part(self.re, other.re, 1), self._part(self.im, other.im, 1))

    def __sub__(self, other):
        return _Complex(self.unit, self._part(self.re, other.re, -1), self._part(self.im, other.im, -1))

    def _product(self, re, im, times):
        def of(part, factor):
            return None if part is None else times(part, factor)

        return _Complex(
            self.unit,
            self._part(of(self.re, re), of(self.im, im), -1),
            self._part(of(self.re, im), of(self.im, re), 1),
        )

    def turned(self, k, n):
        """Return the number times exp(−j2πk/n)."""
        k %= n
        if k == 0:
            return self
        if 4 * k == n:  # the factor is −j
            return _Complex(self.unit, self.im, self._part(None, self.re, -1))
        if 8 * k % n == 0:  # a rotation by quarters, then a factor (1 − j)/√2
            z = self.turned(k - n // 8, n)
            parts = z._part(z.re, z.im, 1), z._part(z.im, z.re, -1)
            return _Complex(self.unit, *(part and self.unit.scaled(part, np.sqrt(0.5)) for part in parts))
        w = np.exp(-2j * np.pi * k / n)
        return self._product(w.real, w.imag, self.unit.scaled)

    def times(self, w_re, w_im):
        """Return the product of this complex number and `w_re` + j `w_im`, whose parts are lanes."""
        z = self._product(w_re, w_im, self.unit.times)
        return _Complex(self.unit, z.re, self.unit.unbiased(z.im))  # in the real part the biases cancel

    def power(self):
        """Return |z|²."""
        return self.unit.plus(self.unit.square(self.re), self.unit.square(self.im))


def _dft(x):
    """Return Σ_j x_j exp(−j2πjk/n) for k = 0 … n−1, by decimation in frequency."""
    n = len(x)
    if n == 1:
        return x
    half = n // 2
    even = _dft([x[i] + x[i + half] for i in range(half)])
    odd = _dft([(x[i] - x[i + half]).turned(i, n) for i in range(half)])
    return [value for pair in zip(even, odd, strict=True) for value in pair]


def _literal(value):
    if not isinstance(value, types.IntegerLiteral):
        raise TypingError("a shape of the DFT must be a literal")
    return value.literal_value


def _unit(array, builder):
    """Return the arithmetic for the type of an array's numbers."""
    return (_Fixed if array.dtype == types.int16 else _Float)(builder)


@intrinsic
def row_sum(
    typing_context,
    table,
    entries,
    low,
    plus_end,
    minus_start,
    high,
    first_minus,
    zero,
    base,
    top,
    shift,
    out,
    out_index,
):
    """Store the sums of ± table[entry + base + i] minus `zero`, for i < SUM_WIDTH, at `out[out_index:]`.

    A sum is limited to ±`top` and multiplied by 2^`shift`. The entries low … plus_end − 1 are added, and the entries
    minus_start … high − 1 are subtracted, eight rows at a time in bytes. Between these two ranges there may be eight
    more entries. In this middle range, the entries before `first_minus` are added. For the other entries ROW_TOP minus
    the row is added, which is an exclusive or. The rows are bytes up to ROW_TOP, so a sum of eight rows fits a byte.
    Then all odd bytes and all 16-bit words are summed, and Σ even = Σ words − 256 Σ odd, modulo 2¹⁶. In each group of
    VECTOR_BYTES sums the sums with even i are stored first.
    """

    def codegen(context, builder, signature, arguments):
        n_table, n_entries, lo, plus, minus, hi, flip, zero, start, top, shift, n_out, where = arguments
        source = Lanes(context, builder, signature.args[0], n_table)
        entry = Lanes(context, builder, signature.args[1], n_entries)
        target = Lanes(context, builder, signature.args[11], n_out)
        eight = ir.Constant(_SHORT, [8] * SHORT_LANES)
        less = builder.neg(builder.trunc(zero, ir.IntType(16)))
        odd_less = splat(builder, less, _SHORT)
        word_less = splat(builder, builder.mul(less, ir.Constant(less.type, 257)), _SHORT)
        words = [cgutils.alloca_once_value(builder, word_less) for _ in range(SUM_WIDTH // VECTOR_BYTES)]
        odds = [cgutils.alloca_once_value(builder, odd_less) for _ in words]
        for begin, end, combine in ((lo, plus, builder.add), (plus, minus, builder.add), (minus, hi, builder.sub)):
            with cgutils.for_range_slice(builder, begin, end, ir.Constant(begin.type, ROWS_AT_ONCE)) as (i, _):
                places, masks = [], []
                for k in range(ROWS_AT_ONCE):
                    index = builder.add(i, ir.Constant(i.type, k))
                    offset = builder.sext(entry.number(index), ir.IntType(64))
                    places.append(builder.add(offset, start))
                    flipped = builder.icmp_signed(">=", index, flip)
                    mask = builder.select(flipped, ir.Constant(_BYTE, ROW_TOP), ir.Constant(_BYTE, 0))
                    masks.append(splat(builder, mask, _BYTES))
                for v, (word, odd) in enumerate(zip(words, odds, strict=True)):
                    ahead = ir.Constant(start.type, v * VECTOR_BYTES)
                    rows = [source.load(builder.add(place, ahead), _BYTES, 1) for place in places]
                    if begin is plus:
                        rows = [builder.xor(row, mask) for row, mask in zip(rows, masks, strict=True)]
                    pair = builder.bitcast(reduce(builder.add, rows), _SHORT)
                    builder.store(combine(builder.load(word), pair), word)
                    builder.store(combine(builder.load(odd), builder.lshr(pair, eight)), odd)
        highest, bits = (builder.trunc(one, ir.IntType(16)) for one in (top, shift))
        lowest, highest, bits = (splat(builder, one, _SHORT) for one in (builder.neg(highest), highest, bits))
        for v, (word, odd) in enumerate(zip(words, odds, strict=True)):
            odd_sum = builder.load(odd)
            even_sum = builder.sub(builder.load(word), builder.shl(odd_sum, eight))
            for k, whole in enumerate((even_sum, odd_sum)):
                below = builder.select(builder.icmp_signed("<", whole, highest), whole, highest)
                cut = builder.select(builder.icmp_signed(">", below, lowest), below, lowest)
                place = builder.add(where, ir.Constant(where.type, v * VECTOR_BYTES + k * SHORT_LANES))
                target.store(builder.shl(cut, bits), place, 2)
        return context.get_dummy_value()

    i64 = types.int64
    return types.void(table, entries, i64, i64, i64, i64, i64, i64, i64, i64, i64, out, i64), codegen


@intrinsic
def dot(typing_context, x, x_index, y, y_index, count):
    """Return Σ x[x_index + i] · y[y_index + i] modulo 2¹⁶ as int16; i < `count`, which is a multiple of 32."""

    def codegen(context, builder, signature, arguments):
        first, x_start, second, y_start, n = arguments
        sources = [Lanes(context, builder, signature.args[k], one) for k, one in ((0, first), (2, second))]
        nothing = ir.Constant(_SHORT, [0] * SHORT_LANES)
        totals = [cgutils.alloca_once_value(builder, nothing) for _ in range(2)]
        with cgutils.for_range_slice(builder, n.type(0), n, ir.Constant(n.type, 2 * SHORT_LANES)) as (i, _):
            for k, total in enumerate(totals):
                at = builder.add(i, ir.Constant(i.type, k * SHORT_LANES))
                starts = (builder.add(x_start, at), builder.add(y_start, at))
                a, b = (one.load(start, _SHORT, 2) for one, start in zip(sources, starts, strict=True))
                builder.store(builder.add(builder.load(total), builder.mul(a, b)), total)
        sums = builder.add(*(builder.load(total) for total in totals))
        return reduce(builder.add, [builder.extract_element(sums, ir.IntType(32)(k)) for k in range(SHORT_LANES)])

    return types.int16(x, types.int64, y, types.int64, types.int64), codegen


@intrinsic
def first_dft(typing_context, sums_re, sums_im, index, step, n_inputs, n_points, turns, turn_index, out, out_index):
    """Store the DFT over `n_points`, multiplied by phase factors; inputs after the first `n_inputs` are zero.

    Input j consists of the int16 lanes at `index + j · step`. Output r is multiplied by a factor with the real part
    turns[turn_index + 2r] and the imaginary part turns[turn_index + 2r + 1]. The product is stored at `out[out_index +
    r · DFT_POINTS · 2 · lanes]`. The imaginary part of an output is stored one vector after the real part. Factors are
    float32, or int16 in units of 2⁻¹⁶. Outputs have the type of the factors.
    """
    count, points = _literal(n_inputs), _literal(n_points)

    def codegen(context, builder, signature, arguments):
        re, im, first, stride, _, _, factors, turn, target, where = arguments
        unit = _unit(signature.args[8], builder)
        parts = [Lanes(context, builder, signature.args[k], part) for k, part in enumerate((re, im))]
        factor = Lanes(context, builder, signature.args[6], factors)
        out_lanes = Lanes(context, builder, signature.args[8], target)
        x = [_Complex(unit, None, None)] * points
        for j in range(count):
            place = builder.add(first, builder.mul(stride, ir.Constant(stride.type, j)))
            x[j] = _Complex(unit, *(unit.of_sum(part, place) for part in parts))
        for r, y in enumerate(_dft(x)):
            w = [
                splat(
                    builder,
                    factor.number(builder.add(turn, ir.Constant(turn.type, k))),
                    unit.vector,
                )
                for k in (2 * r, 2 * r + 1)
            ]
            z = y.times(*w)
            place = builder.add(where, ir.Constant(where.type, r * DFT_POINTS * 2 * unit.lanes))
            out_lanes.store(z.re, place, unit.align)
            out_lanes.store(z.im, builder.add(place, ir.Constant(place.type, unit.lanes)), unit.align)
        return context.get_dummy_value()

    i64 = types.int64
    signature = types.void(sums_re, sums_im, i64, i64, n_inputs, n_points, turns, i64, out, i64)
    return signature, codegen


def _second(context, builder, signature, arguments, low, high):
    """Return the DFT outputs low … high (negative numbers count from the end) of 16 points at `index`."""
    unit = _unit(signature.args[0], builder)
    lanes = Lanes(context, builder, signature.args[0], arguments[0])
    x = []
    for b in range(DFT_POINTS):
        re = builder.add(arguments[1], ir.Constant(arguments[1].type, b * 2 * unit.lanes))
        im = builder.add(re, ir.Constant(re.type, unit.lanes))
        x.append(_Complex(unit, *(lanes.load(place, unit.vector, unit.align) for place in (re, im))))
    z = _dft(x)
    return [z[g % DFT_POINTS] for g in range(low, high + 1)]


@intrinsic
def second_dft_maximum(typing_context, points, index, low, high, out, out_index):
    """Replace elements of `out[out_index:]` by powers of the DFT outputs low … high where these powers are larger.

    Powers of int16 outputs are in units of 2¹⁴.
    """
    first, last = _literal(low), _literal(high)

    def codegen(context, builder, signature, arguments):
        unit = _unit(signature.args[4], builder)
        target = Lanes(context, builder, signature.args[4], arguments[4])
        best = target.load(arguments[5], unit.vector, unit.align)
        for z in _second(context, builder, signature, arguments, first, last):
            best = unit.larger(z.power(), best)
        target.store(best, arguments[5], unit.align)
        return context.get_dummy_value()

    return types.void(points, types.int64, low, high, out, types.int64), codegen


@intrinsic
def second_dft_store(typing_context, points, index, low, high, out, out_index, bin_stride, part_stride):
    """Store each DFT output g from low to high at `out[out_index + (g − low) · bin_stride]`.

    The imaginary part of an output follows `part_stride` elements after the real part.
    """
    first, last = _literal(low), _literal(high)

    def codegen(context, builder, signature, arguments):
        target = Lanes(context, builder, signature.args[4], arguments[4])
        place = arguments[5]
        for z in _second(context, builder, signature, arguments, first, last):
            target.store(z.re, place, z.unit.align)
            target.store(z.im, builder.add(place, arguments[7]), z.unit.align)
            place = builder.add(place, arguments[6])
        return context.get_dummy_value()

    i64 = types.int64
    return types.void(points, i64, low, high, out, i64, i64, i64), codegen
