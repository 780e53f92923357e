"""Small builders that tests share: chips, batches, received signals."""

from __future__ import annotations

from functools import cache

import numpy as np

from simulated_chain import make_chain
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.crypto.osnma.messages.chain_parameters import KEY_BITS, ChainParameters
from vestige.receiver.front_end.front_end import FrontEnd
from vestige.receiver.samples.recorder import ReceivedSatellite, record_band, straight
from vestige.records import Band, ChipSequence, Handover, SampleBatch
from vestige.signal_generator.noise_kernel import noise_key
from vestige.signal_generator.range_model import RangeModel
from vestige.signal_generator.waveform import open_component
from vestige.signals.definitions import ALL_SIGNALS, CARRIER_HZ, E6C
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey

START = GalileoTime(1372, 480_136)  # 2025-12-12 13:22:16 GST, 16 s into a subframe
# a replay of both bands on a single line of sight, in the model of the correlators
MEACONED = """
kind = "campaign"
seed = 1
start = "2026-11-21T12:00:00 GST"
epochs = 20
interval_s = 30.0
fidelity = "correlators"
[receiver]
cn0_dbhz = 40.0
cn0_e1_dbhz = 40.0
[[attack]]
kind = "meaconing"
start_s = 300
delay_s = 2e-6
power_db = 6.0
"""


@cache
def validated_key(time: GalileoTime, data: bytes = bytes(range(16)), chain_id: int = 1) -> ValidatedKey:
    """Return a key with these bytes: the last one of a chain that ends with it, on air from second 22 to 31."""
    size = next(code for code, bits in KEY_BITS.items() if bits == 8 * len(data))
    parameters = ChainParameters(alpha=b"alpha!", key_size=size)
    chain = make_chain(b"builders", time, 1, chain_id=chain_id, parameters=parameters, last_key=data)
    (key,) = chain.validated_keys()
    return key


def random_chips(rng: np.random.Generator, n: int, svid: int = 11) -> ChipSequence:
    chips = (1 - 2 * rng.integers(0, 2, n)).astype(np.int8)
    return ChipSequence.of(svid=svid, transmit_time=START, chip_rate_hz=E6C.chip_rate_hz, chips=chips)


def handover_at(chips: ChipSequence, start_s: float, doppler_hz: float = 0.0, rate: float = 0.0) -> Handover:
    return Handover(
        svid=chips.svid,
        chips=chips,
        start_time=START + start_s,
        doppler_hz=doppler_hz,
        doppler_rate_hz_per_s=rate,
    )


def batch_of(
    samples: np.ndarray, sample_rate_hz: float, band: Band = Band.E6, center_frequency_hz: float | None = None
) -> SampleBatch:
    return SampleBatch(
        band=band,
        samples=samples.astype(np.complex64),
        sample_rate_hz=sample_rate_hz,
        center_frequency_hz=CARRIER_HZ[band] if center_frequency_hz is None else center_frequency_hz,
        first_sample=0,
        start=START,
    )


def satellite(
    svid: int, range_m: float, rate_mps: float, e1_dbhz: float, e6_dbhz: float, seed: int = 1
) -> dict[Band, ReceivedSatellite]:
    """Return what one satellite puts into both bands."""
    return {
        band: ReceivedSatellite(
            svid=svid,
            components=tuple(open_component(s, svid, seed=seed) for s in ALL_SIGNALS if s.band is band),
            cn0_dbhz=e1_dbhz if band is Band.E1 else e6_dbhz,
            pseudorange=RangeModel(s0_m=range_m, v_mps=rate_mps),
            propagation=lambda _: straight(),
        )
        for band in Band
    }


def received_batch(
    band: Band,
    satellites: list[dict[Band, ReceivedSatellite]],
    *,
    duration_s: float = 0.1,
    rate_hz: float = 5e6,
    seed: int = 1,
    bandwidth_hz: float | None = None,
) -> SampleBatch:
    front_end = FrontEnd(
        sample_rate_hz=rate_hz, bandwidth_hz=bandwidth_hz, oversampling=1 if bandwidth_hz is None else 3
    )
    batches = record_band(
        band,
        tuple(one[band] for one in satellites),
        reference=START,
        front_end=front_end,
        n_samples=int(duration_s * rate_hz),
        noise_key=noise_key(seed, 0, 1),
    )
    return batch_of(np.concatenate([batch.samples for batch in batches]), rate_hz, band)


def metres_to_seconds(metres: float) -> float:
    return metres / SPEED_OF_LIGHT_MPS
