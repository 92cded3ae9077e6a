"""The paper's experiments: one seed again, held against the record of all seeds and the README's table."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sccal.experiments.experiments import run_experiments
from sccal.experiments.magnetometer import WANDER_DEG, WanderingOffset
from sccal.experiments.plan import EXPERIMENTS, PATHS, robot
from sccal.experiments.trial import default_options, simulated_trials
from sccal.logs.run import discover
from tests.runs import written

ROOT = Path(__file__).resolve().parents[2]
RECORD = json.loads((ROOT / "docs" / "experiments.json").read_text(encoding="utf-8"))


def recorded(path: str, key: str) -> dict:
    return next(cell for cell in RECORD["cells"] if (cell["path"], cell["experiment"]) == (path, key))


@pytest.fixture(scope="module")
def trials():
    settings = robot("general", 1, RECORD["duration_s"])
    return simulated_trials(settings, EXPERIMENTS, default_options())


def test_the_record_holds_one_seed_as_it_comes_out_today(trials):
    for experiment, trial in zip(EXPERIMENTS, trials, strict=True):
        cell = recorded("general", experiment.key)
        assert cell["seeds"][0] == 1
        for variant, key in (("without", "sc_ekf"), ("with", "sc_ekf_offset")):
            then, now = cell["variants"][key], trial.of(variant)
            # One drive of twenty: its figures hang on the few fixes about the fault, of which a stand now keeps fewer.
            assert now.rms_m == pytest.approx(then["rms_m"][0], rel=0.15)
            assert now.end_m == pytest.approx(then["end_m"][0], rel=0.25, abs=0.02)


def test_offset_estimation_wins_and_finds_the_constants(trials):
    for trial in trials:
        assert trial.of("with").rms_m < 0.5 * trial.of("without").rms_m
        found = trial.of("with").parameters
        for one, true in zip(
            (found.radius_right_m, found.radius_left_m, found.track_m), trial.true_parameters[:3], strict=True
        ):
            assert one.value == pytest.approx(true, rel=0.01)
            assert abs(one.value - true) < 4.0 * one.sigma


def test_the_fault_is_what_it_says(trials):
    loss, lowered, low = trials
    lost = (loss.fix_t_s > 0.5 * 600.0 + 0.5) & (loss.fix_t_s < 0.7 * 600.0 - 0.5)
    assert not lost.any()
    assert loss.judged.sum() == pytest.approx(240, abs=2)
    for trial, sigma in ((lowered, 1.0), (low, 5.0)):
        true_e = np.interp(trial.fix_t_s, trial.t_s, trial.true_east_m)
        early = trial.fix_t_s < 39.0
        assert np.std((trial.fix_east_m - true_e)[early]) < 0.1
        assert np.std((trial.fix_east_m - true_e)[~early]) == pytest.approx(sigma, rel=0.05)


def test_the_recorded_table_says_what_it_must():
    assert len(RECORD["seeds"]) >= 20
    for path in PATHS:
        for key in ("gps_loss", "low_quality"):
            assert recorded(path, key)["ratio"]["interval_95"][0] > 1.0
    general = recorded("general", "low_quality")
    assert general["within_percent"] == len(RECORD["seeds"]) or general["why_not"]


def test_the_table_in_the_readme_is_that_of_the_record():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    block = re.search(r"<!-- output of: sccal experiments -->\n\n(.*?)<!-- end -->", text, re.DOTALL)
    assert block is not None
    rows = [line.split() for line in block[1].splitlines() if line.strip().startswith(PATHS)]
    assert len(rows) == len(RECORD["cells"])
    for row, cell in zip(rows, RECORD["cells"], strict=True):
        assert row[0] == cell["path"]
        shown = [float(number) for number in re.findall(r"\d+(?:\.\d+)?", " ".join(row[1:]))]
        expected = []
        for key in ("sc_ekf", "sc_ekf_offset"):
            variant = cell["variants"][key]
            expected += [variant["rms_median_m"], *variant["rms_5_95_m"]]
        expected += [cell["variants"][key]["end_median_m"] for key in ("sc_ekf", "sc_ekf_offset")]
        expected += [cell["ratio"]["mean"], *cell["ratio"]["interval_95"]]
        expected += [cell["within_percent"], len(cell["seeds"])]
        assert shown == pytest.approx(expected, rel=0.06)


def test_the_wander_is_seeded_and_of_its_size():
    t_s = np.arange(0.0, 20_000.0)
    one, other = WanderingOffset(3).wander_rad(t_s), WanderingOffset(4).wander_rad(t_s)
    np.testing.assert_array_equal(one, WanderingOffset(3).wander_rad(t_s))
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.2
    assert np.degrees(one.std()) == pytest.approx(WANDER_DEG, rel=0.15)


@pytest.mark.slow
def test_a_given_run_is_judged_by_its_own_fixes_and_a_bad_one_stops_nothing(tmp_path):
    written(tmp_path / "logs" / "good", "ahrs.drift_sigma_deg=2", duration_s=240.0)
    bad = tmp_path / "logs" / "bad"
    written(bad, duration_s=60.0)
    (bad / "gnss.nmea").write_text("")
    told: list[str] = []
    done = run_experiments(1, 120.0, discover([tmp_path / "logs"]), jobs=1, tell=told.append)
    assert [cell.path for cell in done.cells if cell.measured] == ["good"] * len(EXPERIMENTS)
    assert [one.name for one in done.failed] == ["bad"]
    assert "gnss.nmea" in done.failed[0].reason
    measured = [cell for cell in done.cells if cell.measured]
    assert all(np.isfinite(cell.figures["with"].rms_m).all() for cell in measured)
    assert not math.isfinite(measured[0].ratio.low)
    assert len(told) == len(PATHS) + 2
    assert replace(done, cells=()).seeds == (1,)
