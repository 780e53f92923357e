"""Choose the punctual correlator: maximum detector and early detector [WFO, Sec. III-A and III-B].

Theory of operation
-------------------
c_0 … c_{N-1} are the magnitudes of N correlators at equal distances, from early to late. The punctual tap c_i needs its
early and late neighbours c_{i-n} and c_{i+n} for the range offset. The index i therefore runs from n to N−1−n. The
paper lets i run from n to N−n, which is one tap too far.

**Maximum detector.** The detector takes the highest c_i that exceeds the threshold. The detector follows the strongest
signal, which may be a spoofing signal.

**Early detector.** No signal can arrive before the true signal, so the detector takes the earliest peak:

1. do hand-over, correlation and threshold (before the detector);
2. scan from early to late for the first c_i above the threshold;
3. while c_{i+n} > c_i, step to i+1;
4. minimise D_i = |c_{i+n} − c_{i-n}| under the constraint c_i > c_{i+n} ∧ c_i > c_{i-n};
5. if there is no such i, the signal is not detected.

In details that the paper leaves open, vestige makes these choices:

* The chosen tap itself exceeds the threshold. The taps that step 3 passes may be below the threshold.
* If step 3 ends at a tap that is below the threshold or violates the constraint, the scan of step 2 continues after
  this tap. Step 5 applies only if *no* tap satisfies the constraint.
* Step 4 moves to later taps while the next tap satisfies the constraint, exceeds the threshold and has a smaller D. A
  search for the global minimum of D could jump to a symmetric peak of a later and stronger spoofing signal.

The scan only moves forward, and every tap that satisfies threshold and constraint also ends step 3. So steps 2 and 3
together find *the first tap that exceeds the threshold and both its neighbours*. Step 4 ends at the first tap whose
successor is no peak or has no smaller D. The code finds both taps as the first True value of a Boolean array, for all
epochs at once.

All comparisons are strict: a magnitude equal to the threshold does not exceed the threshold. Among equal maxima the
maximum detector takes the earliest maximum. If two taps at the distance n are equal, the early detector takes neither
tap as a peak. With noise, the probability of two equal taps is zero. Without noise, two taps are equal if the peak is
exactly halfway between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from vestige.own_parts import OwnPartError, blamed_on_own_parts, made, require_members

NOT_DETECTED = -1


@runtime_checkable
class Detector(Protocol):
    """Protocol of a detector, which chooses the punctual tap of every epoch."""

    @property
    def spacing(self) -> int:
        """Distance n of the early and late tap from the punctual tap, in taps."""

    def detect(
        self, magnitudes: Float[np.ndarray, "n_epochs n_taps"], threshold: float | Float[np.ndarray, " n_epochs"]
    ) -> Int[np.ndarray, " n_epochs"]:
        """Return the index of the punctual tap of each epoch, or −1 where the signal is not detected.

        Parameters
        ----------
        magnitudes
            Magnitudes |c| of the correlators, early to late, at equal distances. A magnitude of NaN is never detected.
        threshold
            Threshold in the unit of the magnitudes: a single value, or a value for each epoch.

        Raises
        ------
        ValueError
            If there are fewer than 2n + 1 taps.
        """


@dataclass(frozen=True, slots=True, kw_only=True)
class _Spaced:
    spacing: int = 1

    def __post_init__(self) -> None:
        if self.spacing < 1:
            raise ValueError(f"the correlator spacing must be at least 1 correlator, found {self.spacing}")


@dataclass(frozen=True, slots=True, kw_only=True)
class MaximumDetector(_Spaced):
    """Choose the highest tap above the threshold [WFO, Sec. III-A].

    The maximum detector follows the strongest signal.

    Attributes
    ----------
    spacing
        Distance n of the early and late tap from the punctual tap, in taps; 1 or more.

    Raises
    ------
    ValueError
        If the spacing is less than 1.

    Examples
    --------
    >>> import numpy as np
    >>> import vestige as vs
    >>> true_and_later_stronger_signal = np.array([[1.0, 8.0, 1.0, 12.0, 1.0]])  # one epoch, five taps
    >>> vs.MaximumDetector().detect(true_and_later_stronger_signal, threshold=5.7).tolist()
    [3]
    """

    def detect(
        self, magnitudes: Float[np.ndarray, "n_epochs n_taps"], threshold: float | Float[np.ndarray, " n_epochs"]
    ) -> Int[np.ndarray, " n_epochs"]:
        """Return the punctual tap of each epoch; see `Detector.detect` for arguments and errors."""
        candidates = _punctual(magnitudes, self.spacing)
        tap = np.argmax(candidates, axis=1)
        height = np.take_along_axis(candidates, tap[:, None], axis=1)[:, 0]
        return np.where(height > threshold, tap + self.spacing, NOT_DETECTED)


@dataclass(frozen=True, slots=True, kw_only=True)
class EarlyDetector(_Spaced):
    """Choose the earliest peak above the threshold [WFO, Sec. III-B].

    Under Assumption 2 the early detector stays on the true signal, because no other signal arrives earlier.

    Attributes
    ----------
    spacing
        Distance n of the early and late tap from the punctual tap, in taps; 1 or more.

    Raises
    ------
    ValueError
        If the spacing is less than 1.

    Examples
    --------
    >>> import numpy as np
    >>> import vestige as vs
    >>> true_and_later_stronger_signal = np.array([[1.0, 8.0, 1.0, 12.0, 1.0]])  # one epoch, five taps
    >>> vs.EarlyDetector().detect(true_and_later_stronger_signal, threshold=5.7).tolist()
    [1]
    """

    def detect(
        self, magnitudes: Float[np.ndarray, "n_epochs n_taps"], threshold: float | Float[np.ndarray, " n_epochs"]
    ) -> Int[np.ndarray, " n_epochs"]:
        """Return the punctual tap of each epoch; see `Detector.detect` for arguments and errors."""
        n = self.spacing
        punctual = _punctual(magnitudes, n)
        early, late = magnitudes[:, : -2 * n], magnitudes[:, 2 * n :]
        peak = (punctual > np.reshape(threshold, (-1, 1))) & (punctual > early) & (punctual > late)
        asymmetry = np.abs(late - early)  # D_i

        first = np.argmax(peak, axis=1)
        goes_on = np.zeros_like(peak)
        goes_on[:, :-1] = peak[:, 1:] & (asymmetry[:, 1:] < asymmetry[:, :-1])
        tap = np.argmax(~goes_on & (np.arange(peak.shape[1]) >= first[:, None]), axis=1)  # tap at which step 4 ends
        return np.where(peak.any(axis=1), tap + n, NOT_DETECTED)


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnDetector:
    """Detector that a user wrote; vestige checks the results of this detector."""

    kind: str  # name of the detector in a scenario, `module:Name`
    detector: Detector

    @classmethod
    def of(cls, kind: str, detector_class: Any, *, spacing: int) -> OwnDetector:
        """Make a detector from a user's class.

        `OwnPartError` is raised if the class cannot be used.
        """
        detector = made(kind, detector_class, spacing=spacing)
        require_members(kind, detector, Detector)
        if detector.spacing != spacing:
            raise OwnPartError(kind, f"spacing {detector.spacing}", f"{spacing}, with which it was made")
        return cls(kind=kind, detector=detector)

    @property
    def spacing(self) -> int:
        """Distance n of the early and late tap from the punctual tap, in taps."""
        return self.detector.spacing

    def detect(
        self, magnitudes: Float[np.ndarray, "n_epochs n_taps"], threshold: float | Float[np.ndarray, " n_epochs"]
    ) -> Int[np.ndarray, " n_epochs"]:
        """Return the index of the punctual tap of each epoch, or −1 where the signal is not detected.

        Raises
        ------
        OwnPartError
            If the detector raises an exception that is no `VestigeError`. If the detector returns anything other than
            −1 or the index of a possible punctual tap for each epoch.
        """
        with blamed_on_own_parts():
            tap = np.asarray(self.detector.detect(magnitudes, threshold))
        n, last = magnitudes.shape[0], magnitudes.shape[1] - 1 - self.spacing
        if tap.shape != (n,) or tap.dtype.kind not in "iu":
            found = f"{tap.dtype} values of shape {tap.shape} from detect"
            raise OwnPartError(self.kind, found, f"whole numbers of shape {(n,)}, one for each epoch")
        if not np.all((tap == NOT_DETECTED) | ((tap >= self.spacing) & (tap <= last))):
            found = f"indices from {tap.min()} to {tap.max()} from detect"
            raise OwnPartError(self.kind, found, f"{NOT_DETECTED} for none, or {self.spacing} to {last}")
        return tap.astype(np.int64)


DETECTORS: dict[str, type[EarlyDetector] | type[MaximumDetector]] = {"early": EarlyDetector, "maximum": MaximumDetector}


def _punctual(magnitudes: Float[np.ndarray, "n_epochs n_taps"], n: int) -> Float[np.ndarray, "n_epochs n_punctual"]:
    """Return the magnitudes of the taps that have an early and a late neighbour at the distance n."""
    if magnitudes.shape[1] < 2 * n + 1:
        raise ValueError(
            f"a correlator spacing of {n} needs at least {2 * n + 1} correlators, found {magnitudes.shape[1]}"
        )
    return magnitudes[:, n : magnitudes.shape[1] - n]
