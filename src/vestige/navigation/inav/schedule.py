"""Return the type of the I/NAV word that a satellite sends in each page.

The nominal sequence of E1-B takes 30 s, one subframe. Some pages carry different words in the two halves of a minute
[OS-ICD, I/NAV sub-frame layout]. Satellites without FEC2 send word 0 in place of the words 16 to 20. A satellite whose
orbit does not fit into word 16 sends word 5 instead. The three rules above agree with signals that were recorded in
2023 and 2025.
"""

from __future__ import annotations

from vestige.navigation.inav.page import FIRST_PAGE_OFFSET_S, PAGE_S
from vestige.navigation.inav.reduced_ced import REDUCED_CED_WORD
from vestige.navigation.inav.word_table import PARITY_WORDS
from vestige.time import GalileoTime

_MINUTE_S = 60
# word type in each page of a subframe, in the first half and in the second half of a minute
_SEQUENCE: tuple[tuple[int, int], ...] = (
    (2, 2),
    (4, 4),
    (6, 6),
    (7, 9),
    (8, 10),
    (17, 18),
    (19, 20),
    (16, 16),
    (0, 0),
    (0, 0),
    (1, 1),
    (3, 3),
    (5, 5),
    (0, 0),
    (16, 16),
)
_TIME_WORD, _STATUS_WORD = 0, 5


def scheduled_word(start: GalileoTime, *, fec2: bool = True, reduced_ced: bool = True) -> int:
    """Return the type of the word in the page that starts at a time.

    Parameters
    ----------
    start
        Start of the page, an odd whole second.
    fec2
        Whether the satellite sends FEC2 and reduced CED.
    reduced_ced
        Whether the satellite's orbit fits into the reduced CED.

    Raises
    ------
    ValueError
        If no page starts at this time.

    Examples
    --------
    >>> [scheduled_word(GalileoTime(1372, second)) for second in (1, 7, 37, 59)]
    [2, 7, 9, 16]
    """
    half, second = divmod(start.second % _MINUTE_S, _MINUTE_S // 2)
    index, rest = divmod(second - FIRST_PAGE_OFFSET_S, PAGE_S)
    if rest or start.fraction:
        raise ValueError(f"no I/NAV page starts at {start}, expected an odd whole second")
    kind = _SEQUENCE[index][half]
    if not fec2 and kind in (REDUCED_CED_WORD, *PARITY_WORDS):
        return _TIME_WORD
    return _STATUS_WORD if kind == REDUCED_CED_WORD and not reduced_ced else kind
