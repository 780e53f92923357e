"""Collect OSNMA keys and ephemerides from the message that tracking decodes while a recording grows.

Each page is verified when the page arrives, so a new key needs only the computation for the subframe of the key. A RECS
needs a key that is sent within about a minute after the RECS. So keys and pages older than `KEPT_S` are dropped, which
limits the memory. Signed root keys and the chain are kept.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from pathlib import Path

from vestige.crypto.osnma.messages.root_key import RootKey
from vestige.crypto.osnma.osnma_receiver import OsnmaReceiver
from vestige.errors import AuthenticationError
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.inav.page import InavPage
from vestige.recording.assistance.assistance_files import Contents, FileTrust, Settings, contents_of_receiver
from vestige.recording.tracked.message_navigation import EphemerisCollector, authenticated_orbits

KEPT_S = 240.0  # largest age in s of keys and demodulated pages, longer than the wait of a RECS for its key
ISSUES = 3  # number of ephemeris issues of a satellite that are kept, half an hour of a real message


class ReceivedMessage:
    """Navigation message that was decoded so far from a growing recording, as `LiveMessage` of an assistance folder.

    Parameters
    ----------
    path
        Path of the recording, for error messages.
    kept_s
        Age in s up to which keys and pages are kept.
    """

    def __init__(self, path: Path, *, kept_s: float = KEPT_S) -> None:
        self.path = path
        self._kept_s = kept_s
        self._pages: deque[InavPage] = deque()
        self._collector = EphemerisCollector(ISSUES)
        self._trust: FileTrust | None = None
        self._receiver: OsnmaReceiver | None = None
        self._roots: tuple[RootKey, ...] = ()  # root keys from key files that the receiver knows
        self._n_subframes = 0  # number of subframes of earlier receivers with another trust anchor
        self._begun = False

    @property
    def version(self) -> int:
        """Version of the message, a different number after each completed subframe and after the first page."""
        return self._begun + self._n_subframes + (0 if self._receiver is None else self._receiver.n_subframes)

    def take(self, pages: Iterable[InavPage]) -> None:
        """Process the next pages, whose checksums are valid."""
        new = tuple(pages)
        for page in new:
            self._pages.append(page)
            self._collector.take(page)
            if self._receiver is not None:
                self._receiver.process(page)
        if new:
            self._begun = True
            self._forget()

    def finish(self) -> None:
        """Mark the message as complete, and process the last subframe even if this subframe is incomplete."""
        if self._receiver is not None:
            self._receiver.finish()
            self._n_subframes += 1

    def contents(self, settings: Settings) -> Contents | None:
        """Return the keys, root keys and demodulated keys so far, or None before the first page.

        The function raises `AuthenticationError` if there is no trust anchor for the keys.
        """
        if not self._begun:
            return None
        if settings.trust is None:
            raise AuthenticationError(
                f"{self.path}: the keys in its message prove nothing without an OSNMA public key or Merkle tree"
            )
        receiver = self._receiver_for(settings.trust)
        if settings.roots != self._roots:
            receiver.learn(settings.roots)
            self._roots = settings.roots
        return contents_of_receiver(receiver)

    def ephemerides(self) -> tuple[tuple[Ephemeris, ...], frozenset[int]]:
        """Return the ephemerides so far, and the satellites whose ephemerides OSNMA tags have verified."""
        proven = () if self._receiver is None else self._receiver.navigation()
        return authenticated_orbits(self._collector.ephemerides, proven)

    def _receiver_for(self, trust: FileTrust) -> OsnmaReceiver:
        """Return the OSNMA receiver with a trust anchor.

        A new OSNMA receiver processes the kept pages.
        """
        if self._receiver is None or trust != self._trust:
            if self._receiver is not None:
                self._n_subframes += self._receiver.n_subframes
            self._trust, self._receiver, self._roots = trust, OsnmaReceiver(trust.public_keys, trust.tree), ()
            for page in self._pages:
                self._receiver.process(page)
        return self._receiver

    def _forget(self) -> None:
        limit = self._pages[-1].time + -self._kept_s
        if limit >= self._pages[0].time:
            while self._pages[0].time < limit:
                self._pages.popleft()
            if self._receiver is not None:
                self._receiver.forget(limit)
