"""Return the primary and secondary codes of E1-B, E1-C, E6-B and E6-C from a table in the package.

The codes are from the Galileo OS SIS ICD and the Galileo E6-B/C Codes Technical Note (© European Union, used with
acknowledgement). `data/README.md` describes the packed form of the table. The SHA-256 of each section is checked when
the section is read.
"""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.resources import files

import numpy as np
from jaxtyping import Int8, UInt8

from vestige.signals.definitions import SignalDefinition

N_CODES = 50  # [OS-ICD, Annex C], [E6-CODES]

# number of codes, number of chips of each code, and SHA-256, by section [OS-ICD, Annex C], [E6-CODES]
_SECTIONS = {
    "E1-B": (N_CODES, 4092, "384ec87e76ecbf81c84f6766e7064afb603acbe6ca7ae171bf7b8e14261c5854"),
    "E1-C": (N_CODES, 4092, "56721f302855a730260d53e3801e64896eef2e6369154a04fabb2a04f846390c"),
    "E6-B": (N_CODES, 5115, "f0935bd5defc9d6cfa9c1a2543b304c294ec5462a5ed57978dad27b4bd8e1636"),
    "E6-C": (N_CODES, 5115, "6b37386bd6ec98a469eadd7c5274783670cb080b3d533aa58333ed07825d9025"),
    "CS100": (N_CODES, 100, "e5396f2f24e388aac278b18eda18a7e87f3f48614b9a244d293b1bfa80ec7199"),
    "CS25": (1, 25, "041b17776bfbf144ec6639befd6b249a4613f1f9a4ec0919ad145074cbd3da51"),
}


@cache
def _section(name: str) -> UInt8[np.ndarray, "codes chips"]:
    """Return one section of the code table as bits, with a row for each code."""
    table = (files("vestige.signals") / "data" / "galileo_memory_codes.bin").read_bytes()
    start = 0
    for section, (codes, chips, digest) in _SECTIONS.items():
        size = codes * -(-chips // 8)
        if section == name:
            part = table[start : start + size]
            if hashlib.sha256(part).hexdigest() != digest:
                raise ValueError(f"the packaged code table is damaged in section {name}: reinstall vestige")
            return np.unpackbits(np.frombuffer(part, np.uint8).reshape(codes, -1), axis=1, count=chips)
        start += size
    raise ValueError(f"no section {name} in the code table")


def _chips(bits: UInt8[np.ndarray, " n"]) -> Int8[np.ndarray, " n"]:
    """Return bits as read-only chips, which all callers use in common: logic 0 is +1, logic 1 is −1 [OS-ICD, 2.3]."""
    chips = (1 - 2 * bits.astype(np.int8)).astype(np.int8)
    chips.flags.writeable = False
    return chips


@cache
def primary_code(signal: SignalDefinition, svid: int) -> Int8[np.ndarray, " n_chips"]:
    """Return the primary code of `signal` for one satellite as int8 ±1.

    Raises
    ------
    ValueError
        If there is no code for `svid`; the codes are for SVID 1 to 50.
    """
    return _chips(_section(signal.name)[_row(svid)])


@cache
def secondary_code(signal: SignalDefinition, svid: int) -> Int8[np.ndarray, " n_periods"]:
    """Return the secondary code of `signal` for one satellite as int8 ±1, one chip per primary period.

    The result is [1] if the signal has no secondary code.
    """
    row = _row(svid)
    if signal.secondary_length == 1:
        return _chips(np.zeros(1, np.uint8))
    if signal.secondary_length == 25:
        return _chips(_section("CS25")[0])  # every satellite has CS25_1 [OS-ICD, 3.5]
    return _chips(_section("CS100")[row])


@cache
def tiered_code(signal: SignalDefinition, svid: int) -> Int8[np.ndarray, " n_chips"]:
    """Return primary ⊕ secondary code over one whole secondary period as int8 ±1."""
    tiered = np.kron(secondary_code(signal, svid), primary_code(signal, svid))
    tiered.flags.writeable = False
    return tiered


def _row(svid: int) -> int:
    if not 1 <= svid <= N_CODES:
        raise ValueError(f"no Galileo codes for SVID {svid}: expected 1 to {N_CODES}")
    return svid - 1
