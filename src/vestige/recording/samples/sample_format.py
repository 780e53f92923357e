"""Define the sample formats that vestige reads and writes, and convert stored samples to complex64 and back.

The reader converts integers to float32 exactly and without scaling. Unsigned integers are offset binary, so half of
their range is subtracted. 32-bit integers and 64-bit floats are not supported, because float32 cannot represent all
such numbers exactly.

A file or pipe may contain samples of several channels in turn, for example from a recorder with two front ends. A frame
is one sample of each channel.

Real (IF-sampled) samples become complex with zero imaginary part. A front end that reverses the spectrum (high-side
mixing) delivers the conjugate of the signal, and the reader conjugates the samples again. Real samples are not
conjugated, because their spectrum also contains the signal without reversal at the negative frequencies.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from jaxtyping import Complex64, Num, Shaped

SampleType = Literal["int8", "uint8", "int16", "uint16", "float32"]
Layout = Literal["real", "iq", "qi"]

# component: (numpy type, stored value of zero, name in a SigMF datatype); unsigned samples are offset binary
COMPONENTS: dict[SampleType, tuple[str, int, str]] = {
    "int8": ("i1", 0, "i8"),
    "uint8": ("u1", 1 << 7, "u8"),
    "int16": ("i2", 0, "i16"),
    "uint16": ("u2", 1 << 15, "u16"),
    "float32": ("f4", 0, "f32"),
}

LAYOUTS_OF_SIGMF: tuple[Layout, ...] = ("real", "iq")

# SigMF datatypes that are valid but not read, and the reason
NOT_READ = dict.fromkeys(("i32", "u32", "f64"), "float32 cannot hold its values exactly")


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleFormat:
    """Format of stored samples."""

    component: SampleType  # number type of a real sample, or of each component of a complex sample
    layout: Layout  # `real`, or complex with the in-phase component first (`iq`) or second (`qi`)
    big_endian: bool = False  # whether components of several bytes begin with the most significant byte
    channels: int = 1  # number of channels in a frame, which has one sample of each channel
    channel: int = 0  # number of this channel in a frame, from 0

    @property
    def is_complex(self) -> bool:
        """Whether a sample has two components."""
        return self.layout != "real"

    @property
    def dtype(self) -> np.dtype[Any]:
        """Numpy type of one component."""
        return np.dtype((">" if self.big_endian else "<") + COMPONENTS[self.component][0])

    @property
    def components_per_sample(self) -> int:
        """Number of components of a sample: 1 for real samples, 2 for complex samples."""
        return 2 if self.is_complex else 1

    @property
    def sample_bytes(self) -> int:
        """Number of bytes of a sample."""
        return self.dtype.itemsize * self.components_per_sample

    @property
    def frame_bytes(self) -> int:
        """Number of bytes of a frame, which has one sample of every channel."""
        return self.sample_bytes * self.channels

    @property
    def alone(self) -> SampleFormat:
        """Format of the channel's samples in a file without other channels."""
        return replace(self, channels=1, channel=0)

    @property
    def sigmf_datatype(self) -> str:
        """Name of the format in SigMF, which has no name for Q before I."""
        if self.layout == "qi":
            raise ValueError("SigMF has no datatype with Q before I")
        order = ("_be" if self.big_endian else "_le") if self.dtype.itemsize > 1 else ""
        return ("c" if self.is_complex else "r") + COMPONENTS[self.component][2] + order

    def __str__(self) -> str:
        text = {"real": "real", "iq": "I,Q", "qi": "Q,I"}[self.layout]
        place = f", {self.channel + 1} of {self.channels} channels" if self.channels > 1 else ""
        return f"{self.component}{' big-endian' if self.big_endian else ''} {text}{place}"


def _sigmf_formats() -> dict[str, SampleFormat]:
    table: dict[str, SampleFormat] = {}
    for component in COMPONENTS:
        for layout in LAYOUTS_OF_SIGMF:
            for big_endian in (False, True):
                form = SampleFormat(component=component, layout=layout, big_endian=big_endian)
                table.setdefault(form.sigmf_datatype, form)
                # a datatype without suffix is little-endian
                table.setdefault(form.sigmf_datatype.removesuffix("_le"), form)
    return table


SIGMF_FORMATS = _sigmf_formats()


def decode(
    components: Shaped[np.ndarray, " n_components"], form: SampleFormat, *, inverted: bool = False
) -> Complex64[np.ndarray, " n_samples"]:
    """Return the stored components of the format's channel as complex64 samples, without loss of precision."""
    if form.channels > 1:
        components = components.reshape(-1, form.channels, form.components_per_sample)[:, form.channel].reshape(-1)
    values = components.astype(np.float32)
    if zero := COMPONENTS[form.component][1]:
        values -= zero
    if form.layout == "real":
        return values.astype(np.complex64)
    if form.layout == "qi":
        values = np.ascontiguousarray(values.reshape(-1, 2)[:, ::-1]).reshape(-1)
    samples = values.view(np.complex64)
    return samples.conj() if inverted else samples


def encode(
    samples: Complex64[np.ndarray, " n_samples"], form: SampleFormat, *, scale: float = 1.0, inverted: bool = False
) -> Num[np.ndarray, " n_components"]:
    """Return the components to store for samples: `round(scale · sample)`, clipped to the range of the format.

    Values are rounded to the nearest integer, and halves to the nearest even integer. float32 values are neither
    rounded nor clipped. With `scale` 1 and without `inverted`, the bits of float32 values do not change.

    The function raises `ValueError` if a sample is not finite, or if complex samples are given to a real format.

    Parameters
    ----------
    scale
        Number that is stored for a real or imaginary part of 1.0.
    inverted
        Whether to store the conjugate, like a front end with an inverted spectrum.
    """
    if form.layout == "real":
        if np.any(samples.imag):
            raise ValueError("complex samples do not fit a real format: mix them to the intermediate frequency first")
        values = samples.real.copy()
    else:
        values = np.ascontiguousarray(samples.conj() if inverted else samples).view(np.float32)
        if form.layout == "qi":
            values = values.reshape(-1, 2)[:, ::-1].reshape(-1)
    if scale != 1.0:
        values = values * np.float32(scale)
    if not np.isfinite(values).all():
        raise ValueError("samples must be finite numbers")
    if form.component != "float32":
        limits, zero = np.iinfo(form.dtype), COMPONENTS[form.component][1]
        values = np.rint(values).clip(limits.min - zero, limits.max - zero) + zero
    return values.astype(form.dtype)
