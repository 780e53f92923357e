from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simulated_chain import make_chain
from vestige.crypto.osnma.messages.chain_parameters import ChainParameters
from vestige.crypto.osnma.messages.root_key import verify_root_key
from vestige.crypto.osnma.messages.tesla import MAX_STEPS, Chain, Key, fill_gaps, gst_sf, one_way, validate
from vestige.crypto.osnma.operator.signed_messages import sign_kroot
from vestige.errors import AuthenticationError
from vestige.time import GalileoTime

# The chain runs over the end of week 4095, where the week counter of the keys starts again at 0.
START = GalileoTime(4095, 604_800 - 10 * 30)
SIMULATED = make_chain(b"tesla", START, 40, chain_id=2)
KEYS = SIMULATED.keys


def fresh() -> Chain:
    return Chain(SIMULATED.root)


def flip(data: bytes, bit: int) -> bytes:
    return (int.from_bytes(data, "big") ^ 1 << bit).to_bytes(len(data), "big")


def test_one_way_function_by_hand() -> None:
    alpha = bytes.fromhex("a06221261ad9")
    key = bytes.fromhex("ed2ba8f2cc11bda55d2e1283e405eff3")  # official test vector, key of 277230
    time = GalileoTime(1251, 277_200)
    message = key + bytes.fromhex("4e343ad0") + alpha
    assert hashlib.sha256(message).digest()[:16].hex() == "be7801d2d4eb75a7e686054a18c58141"
    assert one_way(key, time, ChainParameters(alpha=alpha)).hex() == "be7801d2d4eb75a7e686054a18c58141"


@pytest.mark.parametrize(
    ("time", "bits"),
    [
        (GalileoTime(1251, 277_200), "4e343ad0"),
        (GalileoTime(4096, 0), "00000000"),
        (GalileoTime(4095, 604_770), "fff93a62"),
    ],
)
def test_gst_sf(time: GalileoTime, bits: str) -> None:
    assert gst_sf(time.gst_seconds).hex() == bits


def test_all_keys_validate_across_the_roll_over() -> None:
    chain = fresh()
    valid = [validate(key, chain) for key in KEYS]
    assert [key.time for key in valid] == [START + 30 * k for k in range(40)]
    assert valid[10].time == GalileoTime(4096, 0)
    assert all(key.disclosed_at - key.time == 22 and key.complete_at - key.time == 31 for key in valid)
    assert {key.chain_id for key in valid} == {2}


@settings(max_examples=25)
@given(st.permutations(range(40)))
def test_keys_validate_in_any_order(order: list[int]) -> None:
    chain = fresh()
    for number in order:
        assert validate(KEYS[number], chain).data == KEYS[number].data


def test_no_bit_of_a_key_can_change_neither_before_nor_after_a_valid_one() -> None:
    for others in ((), (KEYS[7],), (KEYS[3],), (KEYS[5],)):
        chain = fresh()
        for other in others:
            validate(other, chain)
        for bit in range(128):
            with pytest.raises(AuthenticationError, match=f"key of {KEYS[5].time}: .* does not chain"):
                validate(Key(time=KEYS[5].time, data=flip(KEYS[5].data, bit)), chain)
        assert validate(KEYS[5], chain).data == KEYS[5].data


@pytest.mark.parametrize("offset", [-30, 30, 604_800, 4096 * 604_800 // 30 * 30 + 30])
def test_a_key_of_another_time_does_not_validate(offset: int) -> None:
    chain = fresh()
    validate(KEYS[3], chain)
    with pytest.raises(AuthenticationError):
        validate(Key(time=KEYS[20].time + offset, data=KEYS[20].data), chain)


def test_times_off_the_grid_and_wrong_lengths() -> None:
    chain = fresh()
    for offset in (1, 15, 0.5):
        with pytest.raises(AuthenticationError, match="not the start of a subframe"):
            validate(Key(time=KEYS[3].time + offset, data=KEYS[3].data), chain)
    with pytest.raises(AuthenticationError, match="120 bits, the chain has 128"):
        validate(Key(time=KEYS[3].time, data=KEYS[3].data[:15]), chain)


def test_the_root_key_itself_and_keys_before_it() -> None:
    root = SIMULATED.root
    assert root.time == GalileoTime(4095, 604_800 - 3600 - 30)
    chain = fresh()
    assert validate(Key(time=root.time, data=root.data), chain).data == root.data
    before = Key(time=root.time + -30, data=one_way(root.data, root.time + -30, root.parameters))
    assert validate(before, chain).time == root.time + -30
    with pytest.raises(AuthenticationError):
        validate(Key(time=root.time + -60, data=before.data), chain)


def test_the_number_of_steps_is_bounded() -> None:
    with pytest.raises(AuthenticationError, match=f"more than {MAX_STEPS} steps"):
        validate(Key(time=SIMULATED.root.time + 30 * (MAX_STEPS + 1), data=bytes(16)), fresh())


def test_a_run_of_keys_costs_one_step_each(monkeypatch: pytest.MonkeyPatch) -> None:
    steps = 0

    def counting(message: bytes) -> Any:
        nonlocal steps
        steps += 1
        return hashlib.sha256(message)

    chain = fresh()
    validate(KEYS[0], chain)
    monkeypatch.setattr(ChainParameters, "new_hash", property(lambda _: counting))
    for key in KEYS[1:]:
        validate(key, chain)
    assert steps == len(KEYS) - 1


def test_lost_keys_follow_from_later_ones() -> None:
    chain = fresh()
    received = (validate(KEYS[2], chain), validate(KEYS[3], chain), validate(KEYS[12], chain))
    filled = fill_gaps(received, chain)
    assert [Key(time=key.time, data=key.data) for key in filled] == list(KEYS[2:13])
    assert all(key.disclosed_at - key.time == 22 for key in filled)
    with pytest.raises(AuthenticationError, match="no later key"):
        chain.derive(KEYS[13].time)


def test_keys_of_another_chain_are_passed_on() -> None:
    other = make_chain(b"another", START, 4, chain_id=2).validated_keys()
    assert fill_gaps(other[::3], fresh()) == other[::3]


def test_a_later_root_key_of_the_same_chain() -> None:
    """The root key of the next hour is a key of the chain; one with the same fields and another key is not."""
    at_the_hour = next(key for key in KEYS if key.time == GalileoTime(4095, 604_770))
    next_hour = replace(SIMULATED.kroot, root_week=0, root_hour=0, root_key=at_the_hour.data)
    other_key = replace(next_hour, root_key=flip(at_the_hour.data, 0))
    roots = [
        verify_root_key(
            sign_kroot(kroot, SIMULATED.header, SIMULATED.private_key),
            SIMULATED.header,
            (SIMULATED.public_key,),
            near=START,
        )
        for kroot in (SIMULATED.kroot, next_hour, other_key)
    ]
    chain = fresh()
    validate(KEYS[-1], chain)
    assert [chain.holds(root) for root in roots] == [True, True, False]
    assert not chain.holds(make_chain(b"another", START, 4, chain_id=2).root)
