"""Compute the powers of a search fast: screen a part of the chips, then sum all chips at the few offsets that pass.

The engine `segment` is the fastest engine on a processor. `segment_engine` makes the plan, `segment_kernel` has the
loops, and `vector_ir` has the inner loops as LLVM code. No module of vestige outside this folder imports the engine,
except for `choice`.

Theory of operation
-------------------
A sum over the time T with carrier f is cut into segments of M = 160 chips (320 for 8 and 16 ms). Within a segment the
carrier is not removed, which multiplies the power by sinc²(f M / R_c). The loss at the outermost bin is 0.35 dB, or
0.16 dB for 16 ms. R_c is the chip rate, x are the samples summed into chips, and c is the code. Each code offset τ then
needs a sum P_k for each segment k, and a sum Z_m for each bin m:

    P_k(τ) = Σ_n x(τ + M k + n) c(M k + n)          Z_m(τ) = Σ_k P_k(τ) e^{−j2π k m / 256}

**Two stages.** A search of 10¹⁰ cells has a threshold g near 8 σ. If a cell reaches g, the sum of the middle three
quarters of its chips has a magnitude of 6.8 ± 0.5 σ. Two offsets half a chip apart share half of their noise. So the
sum of the two offsets has at least 5.9 ± 0.7 σ, for any delay of the signal between the two offsets. Therefore the
first stage, the screen, adds the chips of the two grids. The screen sums up only the middle three quarters of the
chips, once for two offsets. The two offsets are dropped if the largest magnitude over the screen's bins does not exceed
t = ¾ g − 1.32, which is 4.6 σ. Noise exceeds t at about 0.2 % of the offsets. At the remaining offsets, all chips are
summed up, and only the power of this sum is returned. `theory/screen_loss.py` computes the share of detections that the
screen loses. The screen takes the middle chips, because the code Doppler moves the chips at both ends of the middle
part equally far, in opposite directions. In a search of few cells g can be so low that noise would exceed t too often.
Then all chips are summed up at every offset.

**Screen: sign tables.** Five chips have 16 sign patterns, apart from a common sign. So every sum x(n) ± x(n+1) ± … ±
x(n+4) is computed once for all segments, offsets and codes. P_k is then a sum of 48 table rows or more. The sign of the
first chip in a group of five decides whether the row of the group is added or subtracted. Rows are read at consecutive
offsets, without a multiplication, a branch or a look-up for each sample. A row stores each sum in five bits, in steps
of eight. With chips of σ = 12 the steps add noise 21 dB below the noise of the chips. A sum of five chips is limited to
±4.6 of its standard deviations. A sum of eight rows fits a byte, so eight rows are added as bytes before the sum is
widened to int16. All codes use the same tables for a block of offsets. The distance between two rows is 256 bytes more
than a multiple of 4 kB. Without the 256 bytes all rows would share a few lines of the cache, and the screen would take
twice as long.

**Screen: Doppler transform.** The segments have 240 chips at 4 ms, which costs 0.8 dB at 5 kHz and 0.27 dB on average.
The transform has 128 points, and at least the upper half of its inputs is zero. Two steps of 8 and 16 points compute
this transform, with input k = b + 16 j and output m = r + 8 g,

    y_b[r] = Σ_j P_{b+16j} e^{−j2π j r / 8}        Z_{r+8g} = Σ_b (y_b[r] e^{−j2π b r / 128}) e^{−j2π b g / 16}

in int16 with one lane for each offset. Rounding changes a magnitude by less than 0.03 σ. P_k is limited so that no sum
overflows int16, because additions that saturate take twice as long. The limit of the real and of the imaginary part is
3.9 to 7.8 σ of P_k. In each part, noise reaches the limit in about one of 10⁴ segments at most. A strong signal stays
far above the threshold. For 16 ms the segments of this transform have 960 chips, which costs 1.4 dB at the edge of a
pass.

**All chips.** The segment sums of int16 products are exact. A transform of 256 points in two steps of 16 points
follows, in float32 with one lane for each of eight offsets. A sum over **1 ms** fills an eighth of the inputs and needs
every fourth output. A sum over **2 ms** fills a quarter of the inputs and needs every second output. A sum over **16
ms** has two groups of 128 segments. The bins Z of a group are 62.4 Hz apart. The bins of the two groups are joined
coherently at f ± δ with δ = 15.6 Hz, which gives two sub-bins for each bin. Within a group δ is not removed, which
costs sinc²(δ · 8 ms), 0.22 dB. Neighbouring bins differ by half a cycle over the duration of a group, so the join needs
only signs and two constants.
"""
