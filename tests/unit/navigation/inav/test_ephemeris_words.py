from __future__ import annotations

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.errors import VestigeError
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.inav.ephemeris_words import (
    as_broadcast,
    ephemeris_from_words,
    ephemeris_words,
    sisa_index,
    sisa_m,
    status_word,
)
from vestige.navigation.inav.ionosphere import BroadcastIonosphere
from vestige.navigation.inav.word_table import WORD_LAYOUTS
from vestige.navigation.inav.words import InavWord, time_in_word
from vestige.navigation.orbit import satellite_state
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.time import GalileoTime

RECEIVED = GalileoTime(1372, 480_105)
EPHEMERIS = walker_ephemerides(GalileoTime(1372, 480_000))[0]
BODY = st.integers(0, 2**112 - 1)


@given(BODY, BODY, BODY, BODY, st.integers(0, 2**122 - 1), st.integers(0, 1023))
def test_a_decoded_ephemeris_encodes_to_the_same_words(
    first: int, second: int, third: int, fourth: int, status: int, issue: int
) -> None:
    """Any bits, but for times in the week, a SISA that exists, and the spare bits, which an ephemeris does not hold."""
    bodies = dict(enumerate((first, second, third, fourth), start=1))
    words = {kind: InavWord.decode(kind << 122 | issue << 112 | body) for kind, body in bodies.items()}
    words[5] = InavWord.decode(5 << 122 | status)
    fixed = {
        1: {"toe_s": words[1].raw["toe_s"] % 10080, "reserved": 3},
        2: {"reserved": 1},
        3: {"sisa_index": words[3].raw["sisa_index"] if words[3].raw["sisa_index"] < 126 else 255},
        4: {"toc_s": words[4].raw["toc_s"] % 10080, "spare": 1},
        5: {"spare": WORD_LAYOUTS[5].by_name["spare"].fill, "week": RECEIVED.week, "tow_s": RECEIVED.second},
    }
    bits = {kind: WORD_LAYOUTS[kind].pack({**word.raw, **fixed[kind]}) for kind, word in words.items()}
    decoded = ephemeris_from_words(bits, RECEIVED)
    assert decoded is not None
    assert ephemeris_words(decoded) == {kind: bits[kind] for kind in (1, 2, 3, 4)}
    status_5 = words[5].raw
    made = status_word(
        decoded,
        RECEIVED,
        BroadcastIonosphere.from_word(bits[5]),
        e5b_health=status_5["e5b_health"],
        e5b_data_valid=not status_5["e5b_data_invalid"],
    )
    assert made == bits[5]
    assert time_in_word(made) == (1372, 480_105)


def test_every_field_of_an_ephemeris_gets_through() -> None:
    """Each changed field changes the decoded ephemeris in that field, and in no other."""
    plain = as_broadcast(EPHEMERIS)
    for field in fields(Ephemeris):
        value = getattr(plain, field.name)
        if isinstance(value, GalileoTime):
            changed = value + 60.0
        elif isinstance(value, bool):
            changed = not value
        elif isinstance(value, int):
            changed = value + 1
        else:
            changed = {"sisa_m": 0.5, "sqrt_a": 5441.0}.get(field.name, value + 2.0**-20 if abs(value) > 0.1 else None)
            if changed is None:
                (scale,) = {
                    layout.by_name[field.name].scale
                    for kind, layout in WORD_LAYOUTS.items()
                    if 1 <= kind <= 5 and field.name in layout.by_name
                }
                changed = value + 3 * scale
        other = replace(plain, **{field.name: changed})
        words = {**ephemeris_words(other), 5: status_word(other, RECEIVED)}
        decoded = ephemeris_from_words(words, RECEIVED)
        assert decoded is not None
        different = {one.name for one in fields(Ephemeris) if getattr(decoded, one.name) != getattr(plain, one.name)}
        assert different == {field.name}


@pytest.mark.parametrize("past_s", [0.0, 17.0, 59.75])
def test_what_is_broadcast_is_the_orbit_to_centimetres(past_s: float) -> None:
    moved = replace(EPHEMERIS, toe=EPHEMERIS.toe + past_s, toc=EPHEMERIS.toc + past_s / 2, af0_s=1e-4, af1=1e-11)
    sent = as_broadcast(moved)
    assert (sent.toe.second % 60, sent.toc.second % 60) == (0, 0)
    assert as_broadcast(sent) == sent
    elapsed = np.array([0.0, 3600.0])
    true, told = (satellite_state(one, EPHEMERIS.toe, elapsed) for one in (moved, sent))
    assert np.linalg.norm(true.position_m - told.position_m, axis=1).max() < 0.1
    assert np.abs(true.clock_s - told.clock_s).max() < 1e-10


def test_only_whole_minutes_fit() -> None:
    with pytest.raises(
        VestigeError, match=r"^E01: toe is 2025-12-12T13:20:07.000 GST; the message holds whole minutes"
    ):
        ephemeris_words(replace(EPHEMERIS, toe=EPHEMERIS.toe + 7.0))
    with pytest.raises(VestigeError, match=r"^E01: toc is "):
        ephemeris_words(replace(EPHEMERIS, toc=EPHEMERIS.toc + 0.5))


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("sqrt_a", 9000.0, r"^E01: I/NAV word 1: sqrt_a is 9000 m\^0.5; its 32 bits in the message hold 0 to 8192"),
        ("af0_s", 0.5, "^E01: I/NAV word 4: af0_s is 0.5 s"),
        ("bgd_e1_e5b_s", 2e-7, "^E01: I/NAV word 5: bgd_e1_e5b_s is 2e-07 s"),
        ("eccentricity", math.nan, "^E01: I/NAV word 1: eccentricity is nan"),
    ],
)
def test_what_does_not_fit_is_one_line(field: str, value: float, message: str) -> None:
    with pytest.raises(VestigeError, match=message):
        as_broadcast(replace(EPHEMERIS, **{field: value}))


def test_accuracy_index_and_back() -> None:
    assert [sisa_index(sisa_m(index)) for index in range(126)] == list(range(126))
    assert (sisa_index(math.nan), sisa_index(7.0), sisa_index(0.991)) == (255, 255, 75)
    assert math.isnan(sisa_m(sisa_index(7.0)))
