"""The int8 engine: sums over short segments of chips from tables of signs, then a short Doppler transform of them.

It is three times as fast as `fft` on a processor, and it is written for that: `segment_engine` plans, `segment_kernel`
has the loops, `vector_ir` the inner ones as LLVM code. Nothing outside this folder needs to know how it works; only
`choice` imports it.

Theory of operation
-------------------
A sum over T with carrier f is cut into segments of M = 160 chips (320 for 8 and 16 ms); within a segment the carrier is
left in, which costs sinc²(f M / R_c), 0.35 dB at the outermost bin. One code offset τ then needs

    P_k(τ) = Σ_n x(τ + M k + n) c(M k + n)          Z_m(τ) = Σ_k P_k(τ) e^{−j2π k m / 256}

**Sign tables.** Five chips have 16 sign patterns but for a common sign. So every x(n) ± x(n+1) ± … ± x(n+4) is computed
once, for all segments, offsets and codes, and a P_k is a sum of 32 or 64 table rows, added or subtracted after the sign
of the group's first chip. Rows are read at 512 consecutive offsets, without a multiplication, a branch or a look-up by
sample. They are bytes, half of a sum and 64: two of them are added in one byte, and only that is widened to int16. So
less is read and added, and the tables of 4 ms, 1 MB for both parts, stay in the cache. At σ = 12 the halving adds noise
33 dB below that of the samples, and a sum beyond 4.7 σ is cut; from the table rows on all is exact.

**Doppler transform.** 256 points in two steps of 16: input k = b + 16 j, output m = r + 16 g,

    y_b[r] = Σ_j P_{b+16j} e^{−j2π j r / 16}        Z_{r+16g} = Σ_b (y_b[r] e^{−j2π b r / 256}) e^{−j2π b g / 16}

in float32 with one lane for each offset; the upper half of the inputs is zero, and only wanted outputs are made.

**1 and 2 ms** fill an eighth or a quarter of the inputs and want every fourth or second output. **16 ms** are two
groups of 128 segments; the Z of each, 62.4 Hz apart, are joined coherently at f ± δ, two sub-bins to a bin. Within a
group δ is left in: sinc²(δ · 8 ms), 0.22 dB. A group lasts half a cycle of the bins' distance, so the join needs signs
and two constants only.
"""
