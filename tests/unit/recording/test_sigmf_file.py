from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import sigmf
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vestige.errors import InputFileError, UnsupportedError, VestigeError
from vestige.recording.description import RecordingDescription
from vestige.recording.samples.sigmf_file import read_collection, read_sigmf
from vestige.records import Band
from vestige.time import GalileoTime


def metadata(frequency: float = 1575.42e6, **capture: Any) -> dict[str, Any]:
    """Metadata as another program would write them: core fields only."""
    return {
        "global": {"core:datatype": "ci8", "core:version": "1.0.0", "core:sample_rate": 12.5e6},
        "captures": [{"core:sample_start": 0, "core:frequency": frequency, **capture}],
        "annotations": [],
    }


def write(folder: Path, name: str, content: dict[str, Any] | bytes) -> Path:
    (folder / f"{name}.sigmf-data").write_bytes(bytes(20))
    path = folder / f"{name}.sigmf-meta"
    path.write_bytes(
        content if isinstance(content, bytes) else json.dumps(content).encode()
    )  # fmt: skip
    return path


def test_files_of_other_programs(tmp_path: Path) -> None:
    meta = write(tmp_path, "a.b", metadata(**{"core:datetime": "2021-11-25T00:40:00.25Z", "core:global_index": 77}))
    description = read_sigmf([meta], described_in=meta)
    file = description.bands[Band.E1]
    assert file.path == tmp_path / "a.b.sigmf-data"
    assert str(file.form) == "int8 I,Q"
    assert (file.sample_rate_hz, file.center_frequency_hz, file.first_sample) == (12.5e6, 1575.42e6, 77)
    assert file.start == GalileoTime(1161, 348018, 0.25)
    assert (file.spectral_inversion, file.bandwidth_hz, file.stated_samples) == (False, None, None)
    assert description.time_uncertainty_s == float("inf")


def test_own_fields(tmp_path: Path) -> None:
    content = metadata(1278.75e6, **{"vestige:start_gst": "1161:348018.0000000001"})
    content["global"] |= {
        "vestige:spectral_inversion": True, "vestige:bandwidth_hz": 8.7e6, "vestige:time_uncertainty_s": 2,
        "vestige:sample_count": 10, "core:sha512": "A" * 128,
    }  # fmt: skip
    meta = write(tmp_path, "e6", content)
    description = read_sigmf([meta], described_in=meta)
    file = description.bands[Band.E6]
    assert file.start == GalileoTime(1161, 348018, 1e-10)
    assert (file.spectral_inversion, file.bandwidth_hz, file.stated_samples) == (True, 8.7e6, 10)
    assert file.sha512 == "a" * 128
    assert description.time_uncertainty_s == 2


def test_a_capture_that_does_not_begin_at_zero(tmp_path: Path) -> None:
    content = metadata()
    content["global"]["core:offset"] = 500
    content["captures"][0]["core:sample_start"] = 500
    content["captures"].append({"core:sample_start": 600, "core:frequency": 1575.42e6})
    file = read_sigmf([write(tmp_path, "x", content)], described_in=tmp_path).bands[Band.E1]
    assert file.first_sample == 500  # the index of an omitted core:global_index


def test_samples_in_a_file_of_another_name(tmp_path: Path) -> None:
    content = metadata(**{"core:header_bytes": 4})
    content["global"] |= {"core:dataset": "raw.bin", "core:trailing_bytes": 3}
    (tmp_path / "raw.bin").write_bytes(bytes(9))
    file = read_sigmf([write(tmp_path, "x", content)], described_in=tmp_path).bands[Band.E1]
    assert (file.path.name, file.header_bytes, file.trailing_bytes) == ("raw.bin", 4, 3)


def test_bands_are_told_by_their_carrier(tmp_path: Path) -> None:
    frequencies = {"a": 1278.75e6 + 5e6, "b": 1572.42e6, "c": 1176.45e6}
    metas = [write(tmp_path, name, metadata(frequency)) for name, frequency in frequencies.items()]
    description = read_sigmf(metas, described_in=tmp_path)
    assert {band: file.path.stem for band, file in description.bands.items()} == {Band.E6: "a", Band.E1: "b"}
    assert description.notes == ("c.sigmf-meta: neither the E1 nor the E6 carrier lies in its spectrum; not used",)
    with pytest.raises(InputFileError, match=r"found b\.sigmf-meta and d\.sigmf-meta, expected one recording"):
        read_sigmf([*metas, write(tmp_path, "d", metadata())], described_in=tmp_path)
    with pytest.raises(InputFileError, match="no E1 or E6 samples"):
        read_sigmf(metas[2:], described_in=tmp_path)


E1_TIME, E6_TIME = {"core:datetime": "2021-11-25T00:40:00Z"}, {"core:datetime": "2021-11-25T00:40:00.000400Z"}
E1_EXACT, E6_EXACT = {"vestige:start_gst": "1161:348018"}, {"vestige:start_gst": "1161:348018.0004"}
COUNT_0, COUNT_5000 = {"core:global_index": 0}, {"core:global_index": 5000}  # 400 µs at 12.5 MHz


@pytest.mark.parametrize(
    ("e1", "e6", "e6_fraction"),
    [
        (E1_TIME | COUNT_0, E6_TIME | COUNT_5000, 4e-4),
        (E1_TIME | COUNT_0, E1_TIME | COUNT_5000, 4e-4),  # labels to the millisecond only: the counter rules
        (E1_EXACT | COUNT_0, E1_TIME | COUNT_5000, 4e-4),
        (E1_EXACT | COUNT_0, E6_EXACT | COUNT_5000, 4e-4),
        (E1_EXACT, E1_EXACT, 0.0),
        (E1_EXACT, {"vestige:start_gst": "1161:348018.0000000001"}, 1e-10),  # kept to the bit, so that files round-trip
        (E1_TIME, {}, 0.0),
        ({}, E1_TIME, 0.0),
        (COUNT_0, E6_TIME | COUNT_5000, 4e-4),
        ({}, {}, None),
    ],
)
def test_two_bands_on_one_counter(
    tmp_path: Path, e1: dict[str, Any], e6: dict[str, Any], e6_fraction: float | None
) -> None:
    metas = [write(tmp_path, "e1", metadata(**e1)), write(tmp_path, "e6", metadata(1278.75e6, **e6))]
    bands = read_sigmf(metas, described_in=tmp_path).bands
    if e6_fraction is None:
        assert bands[Band.E1].start is bands[Band.E6].start is None
    else:
        for band, fraction in ((Band.E1, 0.0), (Band.E6, e6_fraction)):
            start = bands[band].start
            assert start is not None
            assert abs(start - GalileoTime(1161, 348018, fraction)) < 1e-15


@pytest.mark.parametrize(
    ("e1", "e6"),
    [
        (E1_TIME, E6_TIME),  # no counter: 400 µs apart may be true or the resolution of the label
        (E1_EXACT, E6_EXACT),
        (E1_EXACT | COUNT_5000, E6_EXACT | COUNT_0),
        (E1_TIME | COUNT_0, {"core:datetime": "2021-11-25T00:40:01Z"} | COUNT_0),
        (E1_EXACT | {"core:global_index": 1 << 53}, E1_TIME | COUNT_0),
    ],
)  # fmt: skip
def test_bands_that_contradict_each_other(tmp_path: Path, e1: dict[str, Any], e6: dict[str, Any]) -> None:
    metas = [write(tmp_path, "e1", metadata(**e1)), write(tmp_path, "e6", metadata(1278.75e6, **e6))]
    with pytest.raises(InputFileError):
        read_sigmf(metas, described_in=tmp_path)


def changed(place: str, value: Any) -> dict[str, Any]:
    content = metadata()
    *way, key = place.split("/")
    target: Any = content
    for step in way:
        target = target[int(step) if step.isdigit() else step]
    if value is None:
        del target[key]
    else:
        target[key] = value
    return content


@pytest.mark.parametrize(
    ("place", "value", "said"),
    [
        ("captures", None, "'captures' is a required property"),
        ("global/core:datatype", None, "'core:datatype' is a required property"),
        ("global/core:datatype", "ci4", "pattern"),
        ("global/core:datatype", "cf32_lexyz", "a SigMF datatype"),
        ("global/core:sample_rate", None, "core:sample_rate: found nothing, expected a number from 100000 to 1e+10"),
        ("global/core:sample_rate", -1, "found -1, expected exclusiveMinimum 0"),
        ("global/core:sample_rate", 1.0, "core:sample_rate: found 1.0, expected a number from 100000"),
        ("global/core:sample_rate", 1e11, "found 100000000000.0, expected a number from 100000"),
        ("global/core:sample_rate", "12e6", "found 12e6, expected type number"),
        ("global/core:sample_rate", True, "found True, expected type number"),
        ("captures/0/core:frequency", None, "core:frequency: found nothing"),
        ("captures/0/core:frequency", -1575.42e6, "expected a number from 0"),
        ("captures/0/core:global_index", -1, "expected minimum 0"),
        ("captures/0/core:global_index", 1 << 60, "core:global_index: found 1152921504606846976"),
        ("captures/0/core:sample_start", 7, "expected 0, the first sample"),
        ("captures/0/core:datetime", "2021-11-25", "core:datetime: found 2021-11-25, expected a time"),
        ("captures/0/core:datetime", "9999-12-31T23:59:59Z", "expected a time"),
        ("captures/0/vestige:start_gst", 5, "expected a time"),
        ("captures/0/vestige:start_gst", "-1:5", "expected a time"),
        ("global/vestige:bandwidth_hz", -1, "vestige:bandwidth_hz: found -1, expected greater than 0"),
        ("global/vestige:time_uncertainty_s", "1", "expected a valid number"),
        ("global/vestige:inverted", True, "vestige:inverted: found an unknown key, expected one of spectral_inversion"),
        ("global/core:dataset", "elsewhere.bin", "found elsewhere.bin, which is not there"),
        ("global/core:metadata_only", True, "metadata without samples"),
        ("global/core:trailing_bytes", -5, "minimum 0"),
    ],
)
def test_bad_metadata_are_named(tmp_path: Path, place: str, value: Any, said: str) -> None:
    meta = write(tmp_path, "x", changed(place, value))
    with pytest.raises(InputFileError) as caught:
        read_sigmf([meta], described_in=meta)
    assert str(caught.value).startswith(f"{meta}: ")
    assert said in str(caught.value)
    assert str(caught.value).isprintable()


def test_labels_that_contradict_each_other(tmp_path: Path) -> None:
    meta = write(
        tmp_path, "x", metadata(**{"core:datetime": "2021-11-25T00:40:01Z", "vestige:start_gst": "1161:348018"})
    )
    with pytest.raises(InputFileError, match="the same time as core:datetime"):
        read_sigmf([meta], described_in=meta)


@pytest.mark.parametrize(
    ("place", "value", "said"),
    [
        ("global/core:datatype", "cf64_le", "cannot hold its values exactly"),
        ("global/core:num_channels", 2, "one channel"),
        ("captures", [{"core:sample_start": 0, "core:frequency": 1575.42e6},
                      {"core:sample_start": 5, "core:frequency": 1575.42e6, "core:global_index": 6}], "a gap"),
        ("captures", [{"core:sample_start": 0, "core:frequency": 1575.42e6},
                      {"core:sample_start": 5, "core:frequency": 1278.75e6}], "another frequency"),
    ],
)  # fmt: skip
def test_what_is_not_read_says_so(tmp_path: Path, place: str, value: Any, said: str) -> None:
    meta = write(tmp_path, "x", changed(place, value))
    with pytest.raises(UnsupportedError, match=said):
        read_sigmf([meta], described_in=meta)


@pytest.mark.parametrize(
    "content", [b"", b"null", b"[]", b"\xff\xfe", b'{"global":', b"[" * 100_000, b'{"global": NaN}', b"1" * 5000,
                b'{"global":{},"captures":{},"annotations":[]}', b'{"a":' * 300 + b"1" + b"}" * 300]
)  # fmt: skip
def test_garbage_is_refused(tmp_path: Path, content: bytes) -> None:
    meta = write(tmp_path, "x", content)
    with pytest.raises(InputFileError):
        read_sigmf([meta], described_in=meta)
    collection = tmp_path / "c.sigmf-collection"
    collection.write_bytes(content)
    with pytest.raises(InputFileError):
        read_collection(collection)


def refusal(read: Callable[[], RecordingDescription]) -> str:
    """The one line with which a file is refused, or an empty text."""
    try:
        assert read().bands
    except VestigeError as error:
        return str(error)
    return ""


GOOD = json.dumps(metadata(**{"core:datetime": "2021-11-25T00:40:00Z", "core:global_index": 3})).encode()


@given(cut=st.integers(0, len(GOOD)), garbage=st.binary(max_size=12))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=200)
def test_damage_is_one_clear_line_or_a_recording(tmp_path: Path, cut: int, garbage: bytes) -> None:
    meta = write(tmp_path, "x", GOOD[:cut] + garbage + GOOD[cut + len(garbage) :])
    line = refusal(lambda: read_sigmf([meta], described_in=meta))
    assert not line or (line.startswith(str(tmp_path)) and line.isprintable())


def collection_of(tmp_path: Path, **stream: Any) -> Path:
    meta = write(tmp_path, "x", metadata())
    path = tmp_path / "c.sigmf-collection"
    entry = {"name": "x", "hash": hashlib.sha512(meta.read_bytes()).hexdigest()} | stream
    path.write_text(json.dumps({"collection": {"core:version": "1.2.0", "core:streams": [entry]}}))
    return path


def test_collections(tmp_path: Path) -> None:
    path = collection_of(tmp_path)
    assert sigmf.fromfile(path).get_stream_names() == ["x"]
    description = read_collection(path)
    assert (description.path, set(description.bands)) == (path, {Band.E1})


@pytest.mark.parametrize(
    ("stream", "said"),
    [({"hash": "00"}, "the SHA-512 of x.sigmf-meta"), ({"name": "y"}, "y.sigmf-meta, which is not there"),
     ({"name": "\0"}, "which is not there"), ({"name": "\ud800"}, "which is not there"),
     ({"name": 5}, "an object with the name")],
)  # fmt: skip
def test_bad_collections_are_named(tmp_path: Path, stream: dict[str, Any], said: str) -> None:
    with pytest.raises(InputFileError) as caught:
        read_collection(collection_of(tmp_path, **stream))
    assert said in str(caught.value)
    assert str(caught.value).isprintable()
