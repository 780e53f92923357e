"""Encode the time in word 0, and encode and decode UTC in word 6 and the GPS time offset in word 10.

The interface document defines the models of UTC and of the GPS time offset [OS-ICD, 5.1.7, 5.1.8].
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import timedelta

from vestige.constants import DAY_S, HOUR_S, SECONDS_PER_WEEK
from vestige.navigation.inav.words import InavWord
from vestige.time import GST_EPOCH, LEAP_SECONDS, GalileoTime

TIME_WORD, UTC_WORD = 0, 6
_WEEKS = 4096  # modulus of the week in word 0 [OS-ICD, 4.3.5]
_UTC_WEEKS, _GGTO_WEEKS = 256, 64  # moduli of the weeks in words 6 and 10 [OS-ICD, 4.3.5]
_ANNOUNCED = timedelta(days=180)  # a leap second is announced half a year ahead [IERS Bulletin C]


def time_word(start: GalileoTime) -> int:
    """Return word 0, which gives the time and fills pages without another word.

    Parameters
    ----------
    start
        Start of the page that carries the word, in whole seconds.

    Examples
    --------
    >>> InavWord.decode(time_word(GalileoTime(1372, 480_117))).raw["tow_s"]
    480117
    """
    return InavWord.from_values(TIME_WORD, {"week": start.week % _WEEKS, "tow_s": start.second}).encode()


@dataclass(frozen=True, slots=True, kw_only=True)
class UtcModel:
    """Conversion of Galileo System Time to UTC.

    Attributes
    ----------
    a0_s, a1
        Offset of GST minus UTC in s without the leap seconds, and drift of this offset.
    reference
        Time to which offset and drift refer, a whole hour.
    leap_seconds, leap_seconds_after
        GST minus UTC in whole seconds before and after the leap second.
    leap_day
        Start of the day (in GST) at whose end the leap second is, or was, inserted.
    """

    a0_s: float = 0.0
    a1: float = 0.0
    reference: GalileoTime
    leap_seconds: int
    leap_seconds_after: int
    leap_day: GalileoTime

    @classmethod
    def at(cls, time: GalileoTime) -> UtcModel:
        """Return the model that simulated satellites send at a time, with the leap seconds from `vestige.time`.

        Parameters
        ----------
        time
            Any time. The model refers to the start of the day that contains `time`.
        """
        now = time.utc
        before = [leap for day, leap in LEAP_SECONDS if day <= now]
        current = before[0] if before else LEAP_SECONDS[-1][1]
        announced = [(day, leap) for day, leap in LEAP_SECONDS if day - _ANNOUNCED <= now]
        day, after = announced[0] if announced else LEAP_SECONDS[-1]
        return cls(
            reference=GalileoTime(time.week, time.second - time.second % DAY_S),
            leap_seconds=current,
            leap_seconds_after=after,
            leap_day=GalileoTime.from_calendar(max(day - timedelta(days=1), GST_EPOCH)),
        )

    def word(self, start: GalileoTime) -> int:
        """Return word 6 (128 bits) with the model and the time of a page.

        Parameters
        ----------
        start
            Start of the page that carries the word, in whole seconds.

        Raises
        ------
        VestigeError
            If a value does not fit into its field.
        """
        values = {
            "a0_s": self.a0_s,
            "a1": self.a1,
            "leap_seconds": self.leap_seconds,
            "t0t_s": self.reference.second,
            "utc_week": self.reference.week % _UTC_WEEKS,
            "leap_week": self.leap_day.week % _UTC_WEEKS,
            "leap_day": self.leap_day.second // DAY_S + 1,  # 1 is Sunday [OS-ICD, 5.1.7]
            "leap_seconds_after": self.leap_seconds_after,
            "tow_s": start.second,
        }
        return InavWord.from_values(UTC_WORD, values).encode()

    @classmethod
    def from_word(cls, word: int, received: GalileoTime) -> UtcModel:
        """Return the model in a word 6 of 128 bits.

        Parameters
        ----------
        word
            Word 6.
        received
            Time of reception. A week modulo 256 becomes the full week that is nearest to the reception.
        """
        decoded = InavWord.decode(word)
        day_s = (decoded.raw["leap_day"] - 1) * DAY_S
        return cls(
            a0_s=decoded.value("a0_s"),
            a1=decoded.value("a1"),
            reference=_with_week(decoded.raw["utc_week"], int(decoded.value("t0t_s")), _UTC_WEEKS, received),
            leap_seconds=decoded.raw["leap_seconds"],
            leap_seconds_after=decoded.raw["leap_seconds_after"],
            leap_day=_with_week(decoded.raw["leap_week"], day_s, _UTC_WEEKS, received),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class GpsTimeOffset:
    """Galileo System Time minus GPS time.

    Attributes
    ----------
    a0g_s, a1g
        Offset of GST minus GPS time in s, and drift of this offset.
    reference
        Time to which offset and drift refer, a whole hour.
    """

    a0g_s: float
    a1g: float = 0.0
    reference: GalileoTime

    @classmethod
    def from_word(cls, word: int, received: GalileoTime) -> GpsTimeOffset | None:
        """Return the offset in a word 10 of 128 bits; None if the word has no offset.

        Parameters
        ----------
        word
            Word 10.
        received
            Time of reception, from which the full week of the reference is found.
        """
        decoded = InavWord.decode(word)
        if all(decoded.raw[name] == raw for name, raw in NO_GPS_TIME.items()):
            return None
        second = int(decoded.value("t0g_s"))
        return cls(
            a0g_s=decoded.value("a0g_s"),
            a1g=decoded.value("a1g"),
            reference=_with_week(decoded.raw["ggto_week"], second, _GGTO_WEEKS, received),
        )

    @property
    def fields(self) -> dict[str, float]:
        """Physical values of the offset by name of the field in word 10."""
        return {
            "a0g_s": self.a0g_s,
            "a1g": self.a1g,
            "t0g_s": self.reference.second // HOUR_S * HOUR_S,
            "ggto_week": self.reference.week % _GGTO_WEEKS,
        }


# raw fields of a word 10 without an offset, in which all bits are one [OS-ICD, 5.1.8]
NO_GPS_TIME = {"a0g_s": -1, "a1g": -1, "t0g_s": 255, "ggto_week": 63}


def _with_week(low: int, second: int, weeks: int, received: GalileoTime) -> GalileoTime:
    """Return the time whose week is `low` modulo `weeks` and nearest to the week of reception."""
    week = received.week + (low - received.week + weeks // 2) % weeks - weeks // 2
    return GalileoTime(max(week, 0), second % SECONDS_PER_WEEK)
