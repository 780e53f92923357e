from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from simulated_chain import make_chain
from vestige.crypto.keys.key_file import load_key_file, read_key_file, write_key_file
from vestige.crypto.keys.public_key import PublicKey, Trust
from vestige.crypto.osnma.messages.dsm import NmaHeader
from vestige.crypto.osnma.messages.root_key import verify_root_key
from vestige.crypto.osnma.operator.signed_messages import sign_kroot
from vestige.errors import AuthenticationError, InputFileError, VestigeError
from vestige.time import GalileoTime

START = GalileoTime(1400, 604_740)  # over the end of a week
CHAIN = make_chain(b"key file", START, 6, chain_id=1)
KEYS = CHAIN.validated_keys()
PUBLIC = (CHAIN.public_key,)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "keys.csv"
    write_key_file(path, KEYS, (CHAIN.root,))
    return path


def test_round_trip_proves_itself(path: Path) -> None:
    assert read_key_file(path, PUBLIC) == KEYS
    lines = path.read_text().splitlines()
    assert lines[3] == (f"1400,604740,1,{KEYS[0].data.hex()},1400,604762,{START.calendar:%Y-%m-%dT%H:%M:%S}.000 GST")
    assert lines[5].startswith("1401,0,")
    assert list(path.parent.iterdir()) == [path]


def test_keys_of_two_chains(tmp_path: Path) -> None:
    other = make_chain(b"second", START + 3600, 2, chain_id=2)
    third = make_chain(b"third", START + 7200, 2, chain_id=1)  # the number comes back
    keys = KEYS + other.validated_keys() + third.validated_keys()
    path = tmp_path / "keys.csv"
    write_key_file(path, keys, (CHAIN.root, other.root, third.root))
    assert read_key_file(path, (*PUBLIC, other.public_key, third.public_key)) == keys


def test_what_a_spreadsheet_does_to_it_is_forgiven(path: Path) -> None:
    lines = path.read_text().splitlines()
    path.write_text("\r\n".join(line + "," * (6 - line.count(",")) for line in lines) + "\r\n")
    assert read_key_file(path, PUBLIC) == KEYS


def test_nothing_is_taken_on_trust(path: Path) -> None:
    other = make_chain(b"another operator", START, 1).public_key
    with pytest.raises(AuthenticationError, match=r"keys.csv: line 2: root key: the signature does not verify"):
        read_key_file(path, (other,))
    with pytest.raises(VestigeError, match="PKID 1, which was not given"):
        read_key_file(path, (PublicKey(pkid=9, point=other.point, trust=Trust.USER),))
    text = path.read_text()
    path.write_text(text.replace(text.splitlines()[1] + "\n", ""))
    with pytest.raises(AuthenticationError, match=r"line 3: .* no root key of its chain"):
        read_key_file(path, PUBLIC)


def test_every_changed_digit_of_root_and_keys_is_refused(path: Path) -> None:
    text = path.read_text()
    for line_number in (1, 4):
        line = text.splitlines()[line_number]
        start = text.index(line) + line.rindex(",", 0, 50) + 1 if line_number == 1 else text.index(KEYS[1].data.hex())
        length = len(CHAIN.kroot.serialise()) * 2 if line_number == 1 else 32
        for place in range(start, start + length):
            path.write_text(text[:place] + f"{int(text[place], 16) ^ 1 << place % 4:x}" + text[place + 1 :])
            with pytest.raises(VestigeError):
                read_key_file(path, PUBLIC)


def test_a_false_disclosure_time_is_refused(path: Path) -> None:
    path.write_text(path.read_text().replace(",1400,604762,", ",1400,604792,"))
    with pytest.raises(InputFileError, match="line 4: found disclosed at"):
        read_key_file(path, PUBLIC)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("# vestige OSNMA keys 2", "# vestige OSNMA keys 3"), "line 1"),
        (("# root,1400", "# root,9999999"), "line 2"),
        (("operational", "test"), "line 2, status: found test, expected operational"),
        (("operational,", "operational,9"), "line 2"),
        (("# root,1400,604740,", "# root,1400,604800,"), "line 2, second"),
        (("gst_week", "week"), "line 3"),
        (("1400,604740,1", "1400,604800,1"), "line 4, gst_second"),
        (("1400,604740,1", "1400,604740,4"), "line 4, chain_id"),
        (("1401,0,1", "1401,0,1,1"), "line 6: found 8 fields"),
        (("1401,30,", "1401,0,"), "line 7: found a second key"),
    ],
)
def test_files_that_are_none(path: Path, change: tuple[str, str], words: str) -> None:
    path.write_text(path.read_text().replace(*change, 1))
    with pytest.raises(InputFileError, match=words):
        read_key_file(path, PUBLIC)


def of_version_1(path: Path, header: str = "92") -> None:
    """Make it what vestige wrote before root keys had a time of reception and a status."""
    text = path.read_text().replace("keys 2\n", "keys 1\n")
    path.write_text(re.sub(r"# root,(\d+),\d+,[^,]*,..,", rf"# root,\1,{header},", text))


def test_a_file_of_version_1_is_read_unless_a_root_key_withdraws_something(path: Path) -> None:
    of_version_1(path)
    assert read_key_file(path, PUBLIC) == KEYS
    path.write_text(path.read_text().replace("# root,1400,", "# root,1401,"))
    with pytest.raises(InputFileError, match="line 2, week"):
        read_key_file(path, PUBLIC)
    for header in (0xD2, 0x96, 0x9A, 0x9E):  # don't use; chain revoked, public key revoked, alert
        kroot = sign_kroot(CHAIN.kroot, NmaHeader(header), CHAIN.private_key)
        root = verify_root_key(kroot, NmaHeader(header), PUBLIC, near=START)
        write_key_file(path, KEYS, (root,))
        of_version_1(path, f"{header:02x}")
        with pytest.raises(InputFileError, match=r"line 2: .* write the file again with `vestige osnma verify`"):
            read_key_file(path, PUBLIC)


def test_keys_from_a_signed_withdrawal_on_are_refused(tmp_path: Path) -> None:
    """The root key was received with the third key; the status is its only one, or there is an operational one too."""
    path = tmp_path / "keys.csv"
    for header in (
        status << 6 | chain_id << 4 | keys << 1 for status in range(4) for chain_id in (1, 2) for keys in range(8)
    ):
        kroot = sign_kroot(CHAIN.kroot, NmaHeader(header), CHAIN.private_key)
        withdrawal = verify_root_key(kroot, NmaHeader(header), PUBLIC, near=START + 60)
        refuses = header >> 6 in (0, 3) or header >> 1 & 7 == 7 or (header >> 1 & 7 in (3, 5) and header >> 4 & 3 != 1)
        roots = (withdrawal, CHAIN.root) if header & 2 else (withdrawal,)
        write_key_file(path, KEYS, roots)
        if refuses:
            with pytest.raises(AuthenticationError, match=rf"withdrawn by the signed root key .*0x{header:02X}"):
                read_key_file(path, PUBLIC)
            write_key_file(path, KEYS[:2], roots)
            assert read_key_file(path, PUBLIC) == KEYS[:2]
        else:
            assert read_key_file(path, PUBLIC) == KEYS


def test_keys_from_an_alert_on_are_refused(path: Path) -> None:
    write_key_file(path, KEYS, (CHAIN.root,), (START + 90,))
    with pytest.raises(AuthenticationError, match=r"alert message of .*; leave out the keys from then on"):
        read_key_file(path, PUBLIC)
    write_key_file(path, KEYS[:3], (CHAIN.root,), (START + 90,))
    assert load_key_file(path, PUBLIC).alerts == (START + 90,)
    path.write_text(path.read_text().replace("# alert,1401,30", "# alert,1401"))
    with pytest.raises(InputFileError, match="line 3: found # alert,1401"):
        read_key_file(path, PUBLIC)


def test_truncation_is_seen_or_leaves_whole_keys(path: Path) -> None:
    data = path.read_bytes()
    for length in range(len(data)):
        path.write_bytes(data[:length])
        try:
            keys = read_key_file(path, PUBLIC)
        except VestigeError:
            continue
        assert keys == KEYS[: len(keys)]
        assert data[length - 1 : length] == b"\n"


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_garbage_gives_one_line_and_no_other_key(path: Path, data: st.DataObject) -> None:
    original = path.read_bytes()
    at = data.draw(st.integers(0, len(original)))
    end = data.draw(st.integers(at, min(at + 60, len(original))))
    path.write_bytes(original[:at] + data.draw(st.binary(max_size=60)) + original[end:])
    try:
        keys = read_key_file(path, PUBLIC)
    except VestigeError:
        keys = ()
    finally:
        path.write_bytes(original)
    assert set(keys) <= set(KEYS)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputFileError):
        read_key_file(tmp_path / "absent.csv", PUBLIC)
