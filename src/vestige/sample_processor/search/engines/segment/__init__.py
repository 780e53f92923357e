"""The int8 engine: a screen over half of the chips first, then a sum over all chips at the few offsets that pass.

It is the fastest engine on a processor, and it is written for that: `segment_engine` plans, `segment_kernel` has the
loops, `vector_ir` the inner ones as LLVM code. Nothing outside this folder needs to know how it works; only `choice`
imports it.

Theory of operation
-------------------
A sum over T with carrier f is cut into segments of M = 160 chips (320 for 8 and 16 ms); within a segment the carrier is
left in, which costs sinc²(f M / R_c), 0.35 dB at the outermost bin. One code offset τ then needs

    P_k(τ) = Σ_n x(τ + M k + n) c(M k + n)          Z_m(τ) = Σ_k P_k(τ) e^{−j2π k m / 256}

**Two stages.** A search of 10¹⁰ cells has a threshold g near 8 σ. Half of the chips of a cell that reaches it have a
magnitude of 5.5 ± 0.7 σ, and half as many bins. So the engine first sums up the middle half of the chips only, and
drops every offset whose largest magnitude is below t = (g − 1.5)/√2, 4.5 σ. Noise passes t at about 0.2 % of the
offsets. All chips are summed up there, exactly, and only that power leaves the engine. `theory/screen_loss.py` has the
detections that this costs. The middle half is taken because the code Doppler then moves its chips to both sides alike.
Where g is so low that noise would pass too often (short searches), all chips are summed up everywhere.

**Screen: sign tables.** Five chips have 16 sign patterns but for a common sign. So every x(n) ± x(n+1) ± … ± x(n+4) is
computed once, for all segments, offsets and codes, and a P_k is a sum of 32 or 64 table rows, added or subtracted after
the sign of the group's first chip. Rows are read at consecutive offsets, without a multiplication, a branch or a
look-up by sample. A row has five bits in steps of eight: at σ = 12 of the chips that adds noise 21 dB below theirs, and
a sum beyond 4.6 σ is cut. So eight rows are added in one byte before they are widened to int16. The tables of a block
serve all codes. Their rows lie 256 bytes beyond a multiple of 4 kB apart, else all would share a few places of the
cache, which costs a factor of two.

**Screen: Doppler transform.** 128 points, the upper half of the inputs zero, in two steps of 8 and 16: input
k = b + 16 j, output m = r + 8 g,

    y_b[r] = Σ_j P_{b+16j} e^{−j2π j r / 8}        Z_{r+8g} = Σ_b (y_b[r] e^{−j2π b r / 128}) e^{−j2π b g / 16}

in int16 with one lane for each offset. Rounding moves a magnitude by less than 0.03 σ. Sums stop at the ends of their
range, so a strong signal stays strong. 16 ms take segments of 640 chips here: 0.64 dB at the edge of a pass.

**All chips.** Segment sums of int16 products, exact; then a transform of 256 points in two steps of 16, in float32 with
one lane for each of eight offsets. **1 and 2 ms** fill an eighth or a quarter of the inputs and want every fourth or
second output. **16 ms** are two groups of 128 segments; the Z of each, 62.4 Hz apart, are joined coherently at f ± δ,
two sub-bins to a bin. Within a group δ is left in: sinc²(δ · 8 ms), 0.22 dB. A group lasts half a cycle of the bins'
distance, so the join needs signs and two constants only.
"""
