"""What the operator broadcasts verifies at our receiver: every tag, every MACSEQ, every key."""

from __future__ import annotations

import pytest
from cryptography.hazmat.primitives.asymmetric import ec

from operator_sky import SVIDS, TAGGED, OperatorSky
from simulated_chain import make_chain
from vestige.crypto.keys.public_key import compressed_point
from vestige.crypto.osnma.messages.chain_parameters import KEY_BITS
from vestige.crypto.osnma.messages.dsm import TEST, NmaHeader
from vestige.crypto.osnma.messages.mac_lookup import MAC_LOOKUP, slots
from vestige.crypto.osnma.messages.subframe import SubframeAssembler
from vestige.crypto.osnma.messages.tags import parse_mack
from vestige.crypto.osnma.operator.configuration import OperatorConfiguration
from vestige.crypto.osnma.operator.osnma_operator import OsnmaOperator
from vestige.crypto.osnma.osnma_receiver import OsnmaReceiver
from vestige.crypto.osnma.osnma_report import Count, OsnmaReport
from vestige.errors import UnsupportedError, VestigeError
from vestige.time import GalileoTime

START = GalileoTime(1400, 7200)
N = 14


def sky(n_subframes: int = N, start: GalileoTime = START, seed: bytes = b"sky", **settings: object) -> OperatorSky:
    svids = settings.pop("svids", SVIDS)
    issue_of = settings.pop("issue_of", lambda _svid, _index: 5)
    configuration = OperatorConfiguration(seed=seed, start=start, n_subframes=n_subframes, **settings)
    return OperatorSky(configuration, svids=svids, issue_of=issue_of)


def report_of(one: OperatorSky) -> OsnmaReport:
    return OsnmaReceiver(one.operator.public_keys, one.operator.merkle_tree).process_all(one.pages())


def n_slow(mac_lookup: int, start: GalileoTime, first: int, last: int) -> int:
    """How many tags with ADKD 12 a satellite sends in the subframes first … last."""
    rows = MAC_LOOKUP[mac_lookup]
    return sum(sum(slot.adkd == 12 for slot in rows[(start.second // 30 + k) % 2]) for k in range(first, last + 1))


@pytest.mark.parametrize("mac_lookup", [33, 34, 35])
def test_every_tag_of_a_sky_verifies(mac_lookup: int) -> None:
    one = sky(mac_lookup=mac_lookup)
    report = report_of(one)
    assert (report.problems, report.failures, report.withheld, report.gaps) == ((), (), (), ())
    assert len(report.keys) == N
    n = len(one.svids)
    assert report.tags.macseq == Count(ok=n * (N - 1))
    # The tags of the first subframe are dummies without data; tags whose key is not yet out are not counted.
    assert report.tags.by_adkd[12] == Count(ok=n * n_slow(mac_lookup, START, 1, N - 12))
    assert all(count.failed == 0 for count in report.tags.by_adkd.values())
    assert report.tags.dummy == 0
    assert report.tags.data_before == 0
    authenticated = {(data.svid, data.adkd) for data in report.navigation if data.authenticated}
    assert authenticated == {(svid, adkd) for svid in one.svids for adkd in (0, 4)}


@pytest.mark.parametrize(
    ("key_size", "mac_function", "hash_function", "mac_lookup"),
    # the tables of those sizes: 5 tags with keys of 160 and 192 bits, 4 with 224 and 256
    [
        (0, 0, 0, 34),
        (1, 0, 2, 33),
        (4, 1, 0, 34),
        (4, 0, 2, 27),
        (6, 1, 0, 36),
        (6, 0, 0, 31),
        (8, 1, 2, 39),
        (7, 0, 0, 40),
    ],
)
def test_every_kind_of_chain_verifies(key_size: int, mac_function: int, hash_function: int, mac_lookup: int) -> None:
    one = sky(4, key_size=key_size, mac_function=mac_function, hash_function=hash_function, mac_lookup=mac_lookup)
    report = report_of(one)
    assert (report.problems, report.failures) == ((), ())
    assert [len(key.data) for key in report.keys] == [KEY_BITS[key_size] // 8] * 4
    assert report.tags.macseq == Count(ok=3 * len(one.svids))
    assert report.tags.by_adkd[0].ok > 0
    assert report.tags.by_adkd[0].failed == 0


def test_a_root_key_every_hour_and_the_end_of_the_week() -> None:
    one = sky(30, start=GalileoTime(1400, 604_800 - 300))
    report = report_of(one)
    assert (report.problems, report.failures) == ((), ())
    assert [(root.dsm_id, root.on_known_chain) for root in report.roots] == [(1, False), (2, True)]
    assert report.roots[1].received_at == GalileoTime(1401, 0)
    assert report.verified_roots[1].time == GalileoTime(1400, 604_770)
    assert len(report.keys) == 30


def test_new_navigation_data_restarts_the_cut_off_point() -> None:
    one = sky(8, issue_of=lambda svid, index: 6 if svid == 7 and index >= 4 else 5)
    pages = one.pages()
    report = OsnmaReceiver(one.operator.public_keys).process_all(pages)
    assert (report.problems, report.failures) == ((), ())
    issues = {data.iod_nav for data in report.navigation if data.svid == 7 and data.adkd == 0 and data.authenticated}
    assert issues == {5, 6}
    # COP of tag 0 is in the last bits of the first 7 bytes of the MACK.
    cut_off = {
        (page.svid, (page.time.second - START.second) // 30): page.osnma[3] & 15
        for page in pages
        if page.time.second % 30 == 3
    }
    assert [cut_off[7, k] for k in range(8)] == [0, 1, 2, 3, 4, 1, 2, 3]
    assert [cut_off[2, k] for k in range(8)] == [0, 1, 2, 3, 4, 5, 6, 7]


def test_a_satellite_alone_and_the_blocks_of_its_dsm() -> None:
    one = sky(9, svids=(11,), nma_status=TEST)
    report = report_of(one)
    assert report.failures == ()
    assert report.roots[0].received_at == START + 30 * 7
    assert report.tags.by_adkd[0].failed == 0
    assert {NmaHeader(one.operator.header_at(START).value).status, report.roots[0].header.status} == {TEST}


def test_neighbours_take_turns() -> None:
    """A message authenticates no neighbour twice, and within ten minutes each satellite authenticates all others."""
    one = sky(20)
    parameters = one.operator.chains[0].parameters
    assembler = SubframeAssembler()
    epochs = [epoch for page in one.pages() for epoch in assembler.add(page)[1]] + assembler.flush()
    seen: dict[int, set[int]] = {svid: set() for svid in SVIDS}
    for epoch in epochs[1:]:
        for svid, subframe in epoch.satellites.items():
            mack = parse_mack(subframe, parameters)
            assert mack is not None
            row = slots(parameters, mack.time)
            neighbours = [tag.svid for tag, slot in zip(mack.tags, row, strict=True) if not slot.own]
            assert len(neighbours) == len(set(neighbours)) == 3 + (mack.time.second % 60 == 30)
            seen[svid].update(neighbours)
    assert seen == {svid: set(SVIDS) - {svid} for svid in SVIDS}


def test_a_satellite_that_appears_later() -> None:
    one = sky(6)
    operator = one.operator
    for index in range(6):
        svids = one.svids if index >= 3 else one.svids[1:]
        words = {svid: {w >> 122: w for _, w in one.words(svid, index) if w >> 122 in TAGGED} for svid in svids}
        fields = operator.subframe(START + 30 * index, words)
        assert set(fields) == set(svids)
        assert all(len(field) == 5 for sent in fields.values() for field in sent)


def test_same_settings_same_bits_and_no_zero_byte() -> None:
    pages = sky(4).pages()
    assert pages == sky(4).pages()
    assert pages != sky(4, seed=b"other").pages()
    for seed in range(8):
        assert all(page.osnma[0] and any(page.osnma[1:]) for page in sky(1, seed=bytes([seed])).pages())


def test_the_keys_are_those_of_the_simulated_chain_and_of_the_air() -> None:
    one = sky()
    keys = one.operator.validated_keys()
    chain = make_chain(b"sky", START, N + 11, chain_id=1, parameters=one.operator.chains[0].parameters)
    assert [key.data for key in keys] == [key.data for key in chain.validated_keys()[:N]]
    assert [key.data for key in keys] == [key.data for key in report_of(one).keys]
    assert [key.time for key in keys] == [START + 30 * k for k in range(N)]
    assert {key.disclosed_at - key.time for key in keys} == {22}
    assert one.operator.key_at(START) == keys[0].data


def test_an_own_key_signs() -> None:
    private_key = ec.derive_private_key(12345, ec.SECP256R1())
    one = sky(3, own_key=private_key, pkid=9)
    (key,) = one.operator.public_keys
    assert (key.pkid, key.point) == (9, compressed_point(private_key.public_key()))
    assert report_of(one).failures == ()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"own_key": ec.derive_private_key(5, ec.SECP521R1())}, "secp521r1, expected P-256"),
        ({"pkid": 16}, "pkid: found 16, expected 1 to 15"),
        ({"chain_id": 4}, "chain_id: found 4, expected 0 to 3"),
        ({"nma_status": 3}, "nma_status: found 3, expected 1 to 2"),
        ({"n_subframes": 0}, "n_subframes: found 0"),
        ({"start": START + 1}, "expected the start of a subframe"),
        ({"alpha": b"four"}, "alpha: found 4 bytes, expected 6"),
        ({"key_size": 9}, r"KS \(key size\) is 9"),
        ({"mac_lookup": 99}, "MAC look-up table 99 is not known"),
        ({"mac_lookup": 28}, "has 10 tags, the MACK message 6"),
        ({"notice": b"x" * 40}, "40 bytes, expected 39 at most"),
    ],
)  # fmt: skip
def test_settings_that_are_not_possible(settings: dict[str, object], message: str) -> None:
    with pytest.raises(VestigeError, match=message):
        sky(**settings)


def test_subframes_come_in_order_and_words_are_of_their_type() -> None:
    operator = sky(2).operator
    with pytest.raises(VestigeError, match="the next subframe is"):
        operator.subframe(START + 30, {})
    with pytest.raises(VestigeError, match="E07: found word type 2, expected 1 in 128 bits"):
        operator.subframe(START, {7: {1: 2 << 122}})
    assert operator.subframe(START, {}) == {}
    operator.subframe(START + 30, {})
    with pytest.raises(VestigeError, match="the broadcast ends at"):
        operator.subframe(START + 60, {})
    with pytest.raises(VestigeError, match="and none for"):
        operator.key_at(START + 86_400)


def test_the_row_of_the_look_up_table_has_to_fit() -> None:
    with pytest.raises(UnsupportedError, match="MAC look-up table"):
        OsnmaOperator(OperatorConfiguration(seed=b"", start=START, n_subframes=1, key_size=8))
