"""Encode and decode the ephemeris of a satellite in the I/NAV words 1 to 5 [OS-ICD, 4.3.5].

A toe or toc in the message counts minutes of a week that the message does not name. The decoder uses the week that
gives the time nearest to reception. From a decoded ephemeris, the encoder restores words 1 to 4, but a spare SISA
index becomes 255, and spare and reserved bits get their pattern. Values of any other ephemeris are rounded to the steps
of the message. `as_broadcast` returns the ephemeris that a receiver decodes after the rounding.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from vestige.constants import SECONDS_PER_WEEK
from vestige.errors import VestigeError
from vestige.navigation.ephemeris import NO_ACCURACY, Ephemeris
from vestige.navigation.inav.ionosphere import NO_IONOSPHERE, BroadcastIonosphere
from vestige.navigation.inav.word_table import EPHEMERIS_WORDS, WORD_LAYOUTS
from vestige.navigation.inav.words import InavWord
from vestige.navigation.reissue import referred_to, with_clock_moved
from vestige.time import GalileoTime

STATUS_WORD = 5
WEEKS = 1 << WORD_LAYOUTS[STATUS_WORD].by_name["week"].length  # word 5 carries the week modulo this number
_MINUTE_S = 60  # value of the last bit of toe and toc in s
# first index of each range of the SISA, value at this index in m, and step in m [OS-ICD, SISA]
_SISA_RANGES = ((0, 0.0, 0.01), (50, 0.5, 0.02), (75, 1.0, 0.04), (100, 2.0, 0.16))
_SISA_END, _NO_ACCURACY_INDEX = 126, 255

# Fields of the words that an ephemeris has under the same name and with the same unit: name -> word type
_SAME: Mapping[str, int] = {
    name: kind
    for kind in (*EPHEMERIS_WORDS, STATUS_WORD)
    for name in WORD_LAYOUTS[kind].by_name
    if name in Ephemeris.__dataclass_fields__ and name not in {"svid", "iod_nav", "e1b_health"}
}


def ephemeris_from_words(words: Mapping[int, int], received: GalileoTime) -> Ephemeris | None:
    """Return the ephemeris in the words 1 to 5 of one satellite; None if a word is missing or the IODnav differ.

    Parameters
    ----------
    words
        Word type -> word of 128 bits, whose first bit is the most significant bit.
    received
        Time of reception, from which the week of toe and toc is found.
    """
    if any(kind not in words for kind in (*EPHEMERIS_WORDS, STATUS_WORD)):
        return None
    decoded = {kind: InavWord.decode(words[kind]) for kind in (*EPHEMERIS_WORDS, STATUS_WORD)}
    if len({decoded[kind].raw["iod_nav"] for kind in EPHEMERIS_WORDS}) > 1:
        return None
    return Ephemeris(
        svid=decoded[4].raw["svid"],
        iod_nav=decoded[1].raw["iod_nav"],
        toe=nearest_time(int(decoded[1].value("toe_s")), received),
        toc=nearest_time(int(decoded[4].value("toc_s")), received),
        sisa_m=sisa_m(decoded[3].raw["sisa_index"]),
        e1b_health=decoded[5].raw["e1b_health"],
        e1b_data_valid=decoded[5].raw["e1b_data_invalid"] == 0,
        **{name: decoded[kind].value(name) for name, kind in _SAME.items()},
    )


def ephemeris_words(ephemeris: Ephemeris) -> dict[int, int]:
    """Return the words 1 to 4 of an ephemeris, each field rounded to the steps of the message.

    Parameters
    ----------
    ephemeris
        Ephemeris whose toe and toc are whole minutes, such as the result of `as_broadcast`.

    Returns
    -------
    dict
        Word type 1 to 4 -> word of 128 bits.

    Raises
    ------
    VestigeError
        If toe or toc is not a whole minute, or a value does not fit into its field. The error names the satellite.

    Examples
    --------
    >>> start = GalileoTime(1372, 480_000)
    >>> orbit = Ephemeris(svid=11, iod_nav=9, toe=start, toc=start, sqrt_a=5440.6, eccentricity=0.0, m0_rad=1.0,
    ...     delta_n_radps=0.0, omega0_rad=0.5, omega_dot_radps=0.0, i0_rad=0.98, i_dot_radps=0.0, omega_rad=0.0)
    >>> {kind: InavWord.decode(word).raw["iod_nav"] for kind, word in ephemeris_words(orbit).items()}
    {1: 9, 2: 9, 3: 9, 4: 9}
    """
    own: dict[int, dict[str, float]] = {kind: {"iod_nav": ephemeris.iod_nav} for kind in EPHEMERIS_WORDS}
    own[1]["toe_s"] = _whole_minute(ephemeris, "toe", ephemeris.toe)
    own[3]["sisa_index"] = sisa_index(ephemeris.sisa_m)
    own[4] |= {"svid": ephemeris.svid, "toc_s": _whole_minute(ephemeris, "toc", ephemeris.toc)}
    return {kind: _word(ephemeris, kind, values) for kind, values in own.items()}


def status_word(
    ephemeris: Ephemeris,
    start: GalileoTime,
    ionosphere: BroadcastIonosphere = NO_IONOSPHERE,
    *,
    e5b_health: int | None = None,
    e5b_data_valid: bool | None = None,
) -> int:
    """Return word 5, which carries ionosphere, group delays, health, and the time of the page.

    Parameters
    ----------
    ephemeris
        Ephemeris with the group delays, and with health and data validity of E1-B.
    start
        Start of the page that carries the word, in whole seconds.
    ionosphere
        Coefficients and disturbance flags of the ionosphere model.
    e5b_health, e5b_data_valid
        Health and data validity of E5b; None for the value of E1-B.

    Returns
    -------
    int
        Word of 128 bits.

    Raises
    ------
    VestigeError
        If a value does not fit into its field. The error names the satellite.
    """
    valid = ephemeris.e1b_data_valid if e5b_data_valid is None else e5b_data_valid
    values = {
        **ionosphere.fields,
        "e5b_health": ephemeris.e1b_health if e5b_health is None else e5b_health,
        "e1b_health": ephemeris.e1b_health,
        "e5b_data_invalid": not valid,
        "e1b_data_invalid": not ephemeris.e1b_data_valid,
        "week": start.week % WEEKS,
        "tow_s": start.second,
    }
    return _word(ephemeris, STATUS_WORD, values)


def as_broadcast(ephemeris: Ephemeris) -> Ephemeris:
    """Return the ephemeris that a receiver decodes from the words of an ephemeris.

    The time toe is moved back to a whole minute. The time toc is moved by as much as toe, and then back to a whole
    minute. Then every field is rounded.

    Parameters
    ----------
    ephemeris
        Any ephemeris.

    Raises
    ------
    VestigeError
        If a value does not fit into its field. The error names the satellite.
    """
    moved = referred_to(ephemeris, ephemeris.toe + -_past_minute_s(ephemeris.toe))
    clock = with_clock_moved(moved, -_past_minute_s(moved.toc))
    words = {**ephemeris_words(clock), STATUS_WORD: status_word(clock, moved.toe)}
    decoded = ephemeris_from_words(words, moved.toe)
    if decoded is None:
        raise AssertionError("the words of one ephemeris are of several issues")
    return decoded


def sisa_m(index: int) -> float:
    """Return the signal-in-space accuracy in m of a SISA index; NaN for "no prediction" and spare values.

    The steps are 1, 2, 4 and 16 cm up to 0.5, 1, 2 and 6 m [OS-ICD, SISA].
    """
    if not 0 <= index < _SISA_END:
        return NO_ACCURACY
    first, low, step = max(one for one in _SISA_RANGES if one[0] <= index)
    return low + (index - first) * step


def sisa_index(accuracy_m: float) -> int:
    """Return the smallest SISA index whose accuracy is at least `accuracy_m`; 255, "no prediction", for NaN.

    Parameters
    ----------
    accuracy_m
        Signal-in-space accuracy in m. A value above 6 m has no index, so the result is 255, "no prediction".
    """
    if math.isnan(accuracy_m):
        return _NO_ACCURACY_INDEX
    for index in range(_SISA_END):
        if sisa_m(index) >= accuracy_m - 1e-9:
            return index
    return _NO_ACCURACY_INDEX


def nearest_time(second: int, received: GalileoTime) -> GalileoTime:
    """Return the time nearest to reception that has a given second of the week.

    Parameters
    ----------
    second
        Second of the week, 0 to 604799.
    received
        Time of reception.
    """
    half = SECONDS_PER_WEEK // 2
    return received + float((second - received.second + half) % SECONDS_PER_WEEK - half) + -received.fraction


def _word(ephemeris: Ephemeris, kind: int, values: Mapping[str, float]) -> int:
    own = {name: getattr(ephemeris, name) for name, at in _SAME.items() if at == kind}
    try:
        return InavWord.from_values(kind, {**own, **values}).encode()
    except VestigeError as error:
        raise VestigeError(f"E{ephemeris.svid:02}: {error}") from None


def _whole_minute(ephemeris: Ephemeris, name: str, time: GalileoTime) -> int:
    if _past_minute_s(time):
        raise VestigeError(f"E{ephemeris.svid:02}: {name} is {time}; the message holds whole minutes only")
    return time.second


def _past_minute_s(time: GalileoTime) -> float:
    return time.second % _MINUTE_S + time.fraction
