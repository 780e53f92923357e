from __future__ import annotations

from pathlib import Path

import pytest

from results_builder import campaign_results
from vestige.errors import InputFileError, VestigeError
from vestige.plots.curves.sweep import read_sweep, sweep_of


def test_campaigns_are_counted() -> None:
    campaigns = [
        campaign_results(200, cn0_dbhz=cn0, svids=(3, 8), unavailable=slice(0, 20)) for cn0 in (29.0, 31.0, 40.0)
    ]
    sweep = sweep_of(campaigns, detector="maximum", svid=8)
    assert sweep["cn0_dbhz"].values.tolist() == [29.0, 31.0, 40.0]
    assert sweep["trials"].values.tolist() == [180, 180, 180]
    expected = [int((results["tap_index"].values[1, :, 1] >= 0).sum()) for results in campaigns]
    assert sweep["detections"].values.tolist() == expected
    assert expected[0] < expected[1] < expected[2] == 180
    assert sweep.attrs == {"integration_s": 0.016, "p_fa": 1e-7}


def test_campaigns_must_belong_together() -> None:
    one, other = campaign_results(5), campaign_results(5)
    other.attrs["p_fa"] = 1e-3
    with pytest.raises(VestigeError, match=r"p_fa .*expected one value"):
        sweep_of([one, other])


def test_a_campaign_needs_a_c_over_n0_and_a_correlation() -> None:
    nameless = campaign_results(5)
    del nameless.attrs["cn0_dbhz"]
    for bad in (nameless, campaign_results(5, unavailable=slice(0, 5))):
        with pytest.raises(VestigeError, match="no C/N0 or no correlation"):
            sweep_of([bad])


def test_a_table(tmp_path: Path) -> None:
    path = tmp_path / "sweep.csv"
    path.write_text(
        "detections,cn0_dbhz,note,trials,p_fa,integration_s\n5,30.5,weak,10,1e-7,0.016\n9,32,,10,1e-7,0.016\n"
    )
    sweep = read_sweep(path)
    assert sweep["cn0_dbhz"].values.tolist() == [30.5, 32.0]
    assert sweep["detections"].values.tolist() == [5, 9]
    assert sweep.attrs == {"integration_s": 0.016, "p_fa": 1e-7}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"", "table: found no column cn0_dbhz, or no row"),
        (b"cn0_dbhz,trials\n", "no row"),
        (b"cn0,trials\n30,4\n", "no column"),
        (b"cn0_dbhz,trials\n30,4.5\n", "line 2, trials: found 4.5, expected a whole number"),
        (b"cn0_dbhz,trials\n30\n", "line 2, trials"),
        (b"cn0_dbhz,trials\nnan,4\n", "line 2, cn0_dbhz"),
        (b"cn0_dbhz,trials\n30,9999999999999999999999\n", "line 2, trials"),
        (b"cn0_dbhz,p_fa\n30,1e-7\n31,1e-6\n", "p_fa: found 2 values"),
        (b"cn0_dbhz,p_fa\n30,2\n", "a time above 0 and a probability"),
        (b"cn0_dbhz,integration_s\n30,-1\n", "a time above 0 and a probability"),
        (b"cn0_dbhz\n\xff\xfe\n", "UTF-8"),
        (b'cn0_dbhz,trials\n"30,4\n', "comma-separated text"),
        (b"cn0_dbhz,trials\n30,\x00\n", r"sweep.csv: (table|line 2)"),
    ],
)
def test_bad_tables(tmp_path: Path, text: bytes, message: str) -> None:
    path = tmp_path / "sweep.csv"
    path.write_bytes(text)
    with pytest.raises(InputFileError, match=message) as caught:
        read_sweep(path)
    assert "\n" not in str(caught.value)
