from __future__ import annotations

import re
from pathlib import Path

import pytest

from vestige.errors import InputFileError, VestigeError
from vestige.scenario.load import load_scenario

QUICK = Path(__file__).resolve().parents[3] / "scenarios" / "quick.toml"


@pytest.mark.parametrize(
    ("setting", "text"),
    [
        ("receiver.cn0_dbz=1", "receiver.cn0_dbz: found an unknown key cn0_dbz, expected cn0_dbhz"),
        (
            "zzz=1",
            "zzz: found an unknown key zzz, expected a key of this table of kind campaign: `vestige check --schema` "
            "and docs/scenarios.md list them",
        ),
        (
            "recs.zzz=1",
            "recs.zzz: found an unknown key zzz, expected one of the keys: `vestige check --schema` and "
            "docs/scenarios.md list them",
        ),
        ("recs.evry=1", "recs.evry: found an unknown key evry, expected every"),
        ("receiver.cn0=1", "receiver.cn0: found an unknown key cn0, expected cn0_dbhz"),
        (
            'trajectory={kind="static", latitude_deg=48.0, longitude_deg=11.0, height_m=0.0, speed_mps=5.0}',
            "trajectory.speed_mps: found an unknown key speed_mps, "
            "expected a key of this table of kind static: `vestige check --schema` and docs/scenarios.md list them",
        ),
        (
            "svids=[6]",
            "svids: found an unknown key svids, "
            "expected a key of this table of kind campaign: `vestige check --schema` and docs/scenarios.md list them",
        ),
        (
            "receiver.accelerometers.sigma_bias_mps2=-1",
            "receiver.accelerometers: found sigma_bias_mps2 = -1, expected sigma_bias_mps2 from 0 to 10",
        ),
        (
            'attack=[{kind="osnma-denial", j_over_n_db=10, svids=[6, 6]}]',
            "attack.0.svids: found [6, 6], expected each satellite once",
        ),
        ('attack=[{knd="scer"}]', "attack.0: found an unknown key knd, expected kind"),
        ("receiver.cn0_dbhz=nan", "receiver.cn0_dbhz: found nan, expected a finite number"),
        ("receiver.cn0_dbhz=-1e16", "receiver.cn0_dbhz: found -1e+16, expected a number between -1e+15 and 1e+15"),
        (f"seed={'9' * 400}", f"seed: found {'9' * 79}…, expected a number between -1e+15 and 1e+15"),
        (
            f"seed=0x{'f' * 5000}",
            "seed: found an integer of thousands of digits, expected a number between -1e+15 and 1e+15",
        ),
        ("receiver.cn0_dbhz=none", "receiver.cn0_dbhz: found nothing, expected a value: the key is needed"),
        ("receiver.cn0_dbhz=90", "receiver.cn0_dbhz: found 90, expected at most 80"),
        ("receiver.cn0_dbhz=-1", "receiver.cn0_dbhz: found -1, expected at least 0"),
        ('receiver.cn0_dbhz="x"', 'receiver.cn0_dbhz: found the text "x", expected a number'),
        ('receiver.cn0_dbhz="40"', 'receiver.cn0_dbhz: found the text "40", expected a number'),
        ("receiver.cn0_dbhz=true", "receiver.cn0_dbhz: found True, expected a number"),
        ("epochs=1.5", "epochs: found 1.5, expected a whole number"),
        ("epochs=12.0", "epochs: found 12.0, expected a whole number"),
        ('epochs="12"', 'epochs: found the text "12", expected a whole number'),
        ("epochs=true", "epochs: found True, expected a whole number"),
        ("receiver.e1_multipath=1", "receiver.e1_multipath: found 1, expected true or false"),
        ('receiver.e1_multipath="yes"', 'receiver.e1_multipath: found the text "yes", expected true or false'),
        ("start=12", "start: found 12, expected a text"),
        (
            "start=2026-11-21T16:00:00",
            "start: found datetime.datetime(2026, 11, 21, 16, 0), expected a text in quotes, or a number",
        ),
        (
            'attack=[{kind="osnma-denial", j_over_n_db="10"}]',
            'attack.0.j_over_n_db: found the text "10", expected a number',
        ),
        ('attack=[{kind="osnma-denial", j_over_n_db=true}]', "attack.0.j_over_n_db: found True, expected a number"),
        (
            'attack=[{kind="osnma-denial", j_over_n_db=10, start_s=true}]',
            "attack.0.start_s: found True, expected a number",
        ),
        (
            'attack=[{kind="osnma-denial", j_over_n_db=10, svids=["7"]}]',
            'attack.0.svids.0: found the text "7", expected a whole number',
        ),
        ("interval_s=0.15", "interval_s: found 0.15, expected a multiple of 0.1"),
        ("receiver=3", "receiver: found 3, expected a table"),
        ("receiver.multipath=3", "receiver.multipath: found 3, expected a table"),
        ("receiver.signal=7", "receiver.signal: found 7, expected true or false"),
        ("recs.duration_ms=3", "recs.duration_ms: found 3, expected 1, 2, 4, 8 or 16"),
        ("attack=1", "attack: found 1, expected a list"),
        ("receiver.ionosphere={}", "receiver.ionosphere.kind: found nothing, expected a kind"),
    ],
)
def test_errors_in_our_words(setting: str, text: str) -> None:
    with pytest.raises(InputFileError) as caught:
        load_scenario(QUICK, (setting,))
    assert str(caught.value) == f"{QUICK}: {text}"


@pytest.mark.parametrize(
    ("waveform", "expected"),
    [
        (
            'kind="chirp", span_hz=4e6',
            "a key of this table of kind chirp: `vestige check --schema` and docs/scenarios.md list them",
        ),
        (
            'kind="chirp", last_hz=4e6',
            "a key of this table of kind chirp: `vestige check --schema` and docs/scenarios.md list them",
        ),
        ('kind="chirp", bandwith_hz=4e6', "bandwidth_hz"),
        (
            'kind="pulsed", bandwidth_hz=4e6',
            "a key of this table of kind pulsed: `vestige check --schema` and docs/scenarios.md list them",
        ),
    ],
)
def test_suggestions_are_keys_of_the_same_table(waveform: str, expected: str) -> None:
    """Keys of other tables look alike: `slip_hz` of a phase, `last` of a delay, `bandwidth_hz` of another kind."""
    with pytest.raises(InputFileError) as error:
        load_scenario(QUICK, (f'attack=[{{kind="jamming", j_over_n_db=15, waveform={{{waveform}}}}}]',))
    assert error.value.expected == expected
    assert error.value.place.startswith("attack.0.waveform.")


def test_a_delay_that_is_too_long_names_its_key() -> None:
    with pytest.raises(InputFileError) as error:
        load_scenario(QUICK, ('attack=[{kind="meaconing", delay_s=70, power_db=3}]',))
    assert str(error.value) == (
        f"{QUICK}: attack.0.delay_s: found 70 s, expected a delay of the meaconer from 0 to 60 s"
    )


@pytest.mark.parametrize("setting", ["receiver.cn0_dbhz=", "epochs=", "epochs=-", "attack=", "seed=", "start="])
@pytest.mark.parametrize("digits", [400, 4000, 5000])
def test_integers_of_many_digits_are_one_line(tmp_path: Path, setting: str, digits: int) -> None:
    with pytest.raises(VestigeError, match="expected a"):
        load_scenario(QUICK, (setting + digits * "9",))
    path = tmp_path / "own.toml"
    path.write_text(f"seed = {digits * '9'}\nkind = 'campaign'\n")
    with pytest.raises(InputFileError, match=r"expected (a number between|valid TOML)"):
        load_scenario(path)


def test_a_table_of_many_digits_is_one_line() -> None:
    with pytest.raises(VestigeError, match="is not a table"):
        load_scenario(QUICK, ('attack=[{kind="osnma-denial", j_over_n_db=10}]', f"attack.{5000 * '0'}.start_s=1"))


def test_endless_nesting_is_one_line() -> None:
    with pytest.raises(VestigeError, match="more than 20 tables and lists in each other"):
        load_scenario(QUICK, ("attack=" + 300 * "[" + 300 * "]",))
    # 39 tables in each other, of keys that are short enough
    settings = [f"{'a.' * 19}{name}={{{'a.' * 19}a=1}}" for name in "ab"]
    with pytest.raises(InputFileError, match=r"expected at most 20$"):
        load_scenario(QUICK, settings)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("seed = 1", "kind: found nothing, expected 'campaign' or 'recording'"),
        (
            "[recevier]",
            "top level: found an unknown key recevier, and no kind, expected receiver, and kind = 'campaign' or "
            "'recording'",
        ),
        ("knd = 'campaign'", "top level: found an unknown key knd, expected kind"),
        ("kind = 'campaign'\n[recevier]", "recevier: found an unknown key recevier, expected receiver"),
    ],
)
def test_a_missing_key_does_not_hide_a_misspelt_one(tmp_path: Path, text: str, line: str) -> None:
    path = tmp_path / "own.toml"
    path.write_text(text)
    with pytest.raises(InputFileError, match=re.escape(line)):
        load_scenario(path)
