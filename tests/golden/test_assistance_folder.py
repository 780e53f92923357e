"""From real files to chips: the official OSNMA test vector opens the worked RECS vector of the protocol reference."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from vestige.crypto.recs import recs_file
from vestige.crypto.recs import recs_segment as recs
from vestige.recording.assistance.folder import read_assistance
from vestige.records import ChipSequence
from vestige.time import GalileoTime

EPOCH = GalileoTime(1251, 277216)
KEY = bytes.fromhex(
    "be7801d2d4eb75a7e686054a18c58141"
)  # broadcast in the subframe of 277200, see the protocol reference
NAME = "test_vector_configuration_1"


PAGES = 4 * 15 + 9  # four subframes and a part of the fifth: the key stands in pages 10 to 14 of 15


@pytest.fixture
def folder(osnma_data: Path, tmp_path: Path) -> Path:
    """Return a folder with navigation pages, the Merkle tree that they lead to, and one RECS of zero bits."""
    name = f"{NAME}_2023-08-16T0500.csv"
    header, *satellites = (osnma_data / name).read_text().splitlines()
    rows = (row.split(",") for row in satellites)
    cut = [header, *(f"{svid},{240 * PAGES},{digits[: 60 * PAGES]}" for svid, _, digits in rows)]
    (tmp_path / name).write_text("\n".join(cut))
    shutil.copy(osnma_data / f"{NAME}_merkle_tree.xml", tmp_path)
    chips = ChipSequence.of(svid=11, transmit_time=EPOCH, chip_rate_hz=5.115e6, chips=np.ones(81_840, np.int8))
    path = recs_file.write_recs_file(recs_file.from_segments([recs.encrypt(chips, KEY)]), tmp_path)
    assert path.read_bytes()[16:32].hex() == "17626b2fc56947d056cd143137d1258a"
    return tmp_path


@pytest.mark.judged(
    by="official test vectors",
    what="assistance folder: from OSNMA pages to the chips of a RECS",
    figure="key is disclosed 6 s after the RECS",
)
def test_key_from_the_signal_decrypts_the_recs(folder: Path) -> None:
    result = read_assistance(folder)
    assert not result.problems
    assert [key.time for key in result.assistance.keys] == [EPOCH.subframe + 30 * i for i in range(4)]
    (segment,) = result.assistance.segments
    key = result.assistance.keys[0]
    assert (key.data, key.time) == (KEY, segment.key_time)
    assert key.disclosed_at - segment.transmit_time == pytest.approx(6)  # on air from GST_SF + 22 s
    np.testing.assert_array_equal(recs.decrypt(segment, key).chips, np.ones(81_840))


def test_keys_are_not_taken_on_another_merkle_tree(folder: Path, osnma_data: Path) -> None:
    result = read_assistance(folder, merkle_tree=osnma_data / "recorded_2025-12-12_merkle_tree.xml")
    assert result.assistance.keys == ()
    assert "no root key is verified" in str(result.problems[0])
