from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from sigmf.sigmffile import dtype_info

from vestige.recording.samples.sample_format import COMPONENTS, SIGMF_FORMATS, SampleFormat, decode, encode

FORMATS = [
    SampleFormat(component=component, layout=layout, big_endian=big_endian)  # type: ignore[arg-type]
    for component in COMPONENTS
    for layout in ("real", "iq", "qi")
    for big_endian in (False, True)
]


def stored(form: SampleFormat) -> st.SearchStrategy[np.ndarray]:
    """Components as a file may hold them, every bit pattern but NaN and infinity."""
    elements = st.floats(width=32, allow_nan=False, allow_infinity=False) if form.component == "float32" else None
    sizes = st.integers(0, 20).map(lambda n: n * form.components_per_sample)
    return hnp.arrays(form.dtype, sizes, elements=elements)


@pytest.mark.parametrize("form", FORMATS, ids=str)
@given(data=st.data(), inverted=st.booleans())
@settings(max_examples=40)
def test_what_is_read_is_written_bit_for_bit(form: SampleFormat, data: st.DataObject, inverted: bool) -> None:
    components = data.draw(stored(form))
    samples = decode(components, form, inverted=inverted)
    assert samples.dtype == np.complex64
    written = encode(samples, form, inverted=inverted)
    assert written.dtype == form.dtype
    assert written.tobytes() == components.tobytes()


def test_values_by_hand() -> None:
    raw = np.array([1, 3, -3, -1], np.int8)
    real, iq, qi = (SampleFormat(component="int8", layout=layout) for layout in ("real", "iq", "qi"))  # type: ignore[arg-type]
    assert decode(raw, real).tolist() == [1, 3, -3, -1]
    assert decode(raw, iq).tolist() == [1 + 3j, -3 - 1j]
    assert decode(raw, qi).tolist() == [3 + 1j, -1 - 3j]
    assert decode(raw, iq, inverted=True).tolist() == [1 - 3j, -3 + 1j]
    assert decode(raw, real, inverted=True).tolist() == [1, 3, -3, -1]
    assert decode(np.array([0, 128, 255], np.uint8), SampleFormat(component="uint8", layout="real")).tolist() == [
        -128, 0, 127,
    ]  # fmt: skip
    big = SampleFormat(component="int16", layout="real", big_endian=True)
    assert decode(np.frombuffer(b"\x01\x00\xff\xfe", big.dtype), big).tolist() == [256, -2]


def test_rounding_and_clipping() -> None:
    form = SampleFormat(component="int8", layout="iq")
    samples = np.array([0.5 + 1.5j, 2.5 - 0.5j, 300 - 300j], np.complex64)
    assert encode(samples, form).tolist() == [0, 2, 2, 0, 127, -128]
    assert encode(samples, form, scale=2.0).tolist() == [1, 3, 5, -1, 127, -128]
    offset = SampleFormat(component="uint16", layout="real")
    assert encode(np.array([-4e4, 0, 4e4], np.complex64), offset).tolist() == [0, 32768, 65535]


def test_what_cannot_be_stored_is_our_mistake() -> None:
    with pytest.raises(ValueError, match="real format"):
        encode(np.array([1j], np.complex64), SampleFormat(component="int8", layout="real"))
    for layout in ("iq", "real"):
        with pytest.raises(ValueError, match="finite"):
            encode(np.array([np.nan], np.complex64), SampleFormat(component="int16", layout=layout))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="Q before I"):
        _ = SampleFormat(component="int8", layout="qi").sigmf_datatype


def test_sigmf_names_mean_what_the_library_takes_them_for() -> None:
    assert len(set(SIGMF_FORMATS.values())) == 5 * 2 * 2 - 4  # byte order means nothing for one byte
    for name, form in SIGMF_FORMATS.items():
        theirs = dtype_info(name)
        assert theirs["sample_size"] == form.sample_bytes
        assert theirs["is_complex"] == form.is_complex
        if "_" in name or form.dtype.itemsize == 1:
            assert np.dtype(theirs["component_dtype"]) == form.dtype
