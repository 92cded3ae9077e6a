"""Fixes that judge and never teach: withheld by choice, or a degraded log's fixes as they were before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from sccal.degrade.faults import Faults, fault_run
from sccal.errors import UsageError
from sccal.logs.streams import Reference, Run
from sccal.results.calibration import Calibration
from tests.runs import read, written

WINDOW_S = (90.0, 130.0)


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Run:
    return read(written(tmp_path_factory.mktemp("reference") / "run"))


@pytest.fixture(scope="module")
def withheld(run) -> Calibration:
    return calibrate_run(run, CalibrationOptions(withhold_s=(WINDOW_S,)))[0]


def on_run_clock(run: Run, t_s: np.ndarray) -> np.ndarray:
    return t_s - run.wheels.t_s[0]


def degraded(run: Run, faults: Faults) -> Run:
    """The faults in memory, with the fixes as they were beside them, as a degraded folder holds them."""
    left, before = fault_run(run, faults)
    return replace(left, reference=Reference(before, ~np.isin(before.utc_s, left.fixes.utc_s)))


def values(c: Calibration) -> list[float]:
    p = c.parameters
    return [e.value for e in (p.radius_right_m, p.radius_left_m, p.track_m, p.heading_offset_rad)]


def test_withheld_fixes_judge_the_window(run, withheld):
    judged = withheld.against_reference
    assert judged is not None
    assert judged.displaced_rms_m is None
    (window,) = judged.losses.windows
    t_s = on_run_clock(run, window.t_s)
    assert t_s[0] >= WINDOW_S[0]
    assert t_s[-1] <= WINDOW_S[1]
    assert t_s.size == pytest.approx(5 * 40, abs=2)
    assert 0.0 < window.rms_drift_m < 1.0
    assert window.end_drift_m == window.drift_m[-1]
    assert all(w.end_s <= window.start_s + 1.0 or w.start_s >= window.end_s - 1.0 for w in withheld.outage.windows)


def test_withheld_fixes_teach_nothing(run, withheld):
    t_s = on_run_clock(run, run.fixes.host_t_s)
    inside = (t_s > WINDOW_S[0] - 1.0) & (t_s < WINDOW_S[1] + 1.0)
    core = (t_s > WINDOW_S[0] + 1.0) & (t_s < WINDOW_S[1] - 1.0)
    assert inside.sum() > core.sum() > 100
    moved = replace(run, fixes=replace(run.fixes, lat_deg=run.fixes.lat_deg + np.where(core, 0.01, 0.0)))
    other = calibrate_run(moved, CalibrationOptions(withhold_s=(WINDOW_S,)))[0]
    assert values(other) == values(withheld)
    np.testing.assert_array_equal(other.on_the_way.east_m, withheld.on_the_way.east_m)
    np.testing.assert_array_equal(other.trajectory.north_m, withheld.trajectory.north_m)
    assert other.noise == withheld.noise
    assert other.against_reference.losses.end_rms_m < 1.0 < 1000.0 < other.against_reference.losses.rms_m


def test_a_lost_window_drifts_as_the_same_window_withheld(run, withheld):
    lost = calibrate_run(degraded(run, Faults(losses_s=(WINDOW_S,))), CalibrationOptions())[0]
    ours, theirs = lost.against_reference.losses.windows[0], withheld.against_reference.losses.windows[0]
    assert ours.rms_drift_m == pytest.approx(theirs.rms_drift_m, rel=1e-3)
    assert ours.end_drift_m == pytest.approx(theirs.end_drift_m, rel=1e-3)
    assert values(lost) == pytest.approx(values(withheld), rel=1e-6)


def test_displaced_fixes_are_judged_by_where_they_were(run):
    plain = calibrate_run(run, CalibrationOptions())[0]
    noisy = degraded(run, Faults(sigma_m=2.0))
    blind = calibrate_run(replace(noisy, reference=None), CalibrationOptions())[0]
    told = calibrate_run(noisy, CalibrationOptions())[0]
    assert values(told) == values(blind)
    assert plain.outage.end_rms_m < 0.5 < 2.0 < blind.outage.end_rms_m
    assert told.outage.end_rms_m < 0.4 * blind.outage.end_rms_m
    assert "before they were displaced" in told.outage.how
    assert told.against_reference.losses is None
    assert told.against_reference.displaced == pytest.approx(noisy.fixes.lat_deg.size, rel=0.01)
    assert told.against_reference.displaced_rms_m < 1.0


def test_coarse_fixes_show_neither_arm_nor_latency(run):
    assert calibrate_run(run, CalibrationOptions())[0].unseen == ()
    noisy, _ = fault_run(run, Faults(sigma_m=5.0))
    unseen = calibrate_run(noisy, CalibrationOptions())[0].unseen
    assert [(one.effect, one.parameter) for one in unseen] == [
        ("lever_arm", "forward_m"),
        ("lever_arm", "left_m"),
        ("gnss_latency", "s"),
    ]
    assert all(one.smallest > 6.0 * one.sigma > 0.0 for one in unseen)
    asked = calibrate_run(noisy, CalibrationOptions(effects=("lever_arm",)))[0].unseen
    assert [one.effect for one in asked] == ["gnss_latency"]


def test_a_straight_line_does_not_show_an_arm_beside_a_latency(tmp_path):
    straight = read(written(tmp_path / "run", path="straight", duration_s=120.0))
    unseen = {one.parameter for one in calibrate_run(straight, CalibrationOptions())[0].unseen}
    assert "forward_m" in unseen


def test_a_window_outside_the_run_is_refused(run):
    with pytest.raises(UsageError, match="outside the run"):
        calibrate_run(run, CalibrationOptions(withhold_s=((900.0, 960.0),)))


def test_a_loss_at_the_start_or_the_end_of_a_run_is_survived(run):
    last = float(run.wheels.t_s[-1] - run.wheels.t_s[0])
    for window in ((0.0, 30.0), (last - 30.0, last)):
        c = calibrate_run(run, CalibrationOptions(withhold_s=(window,)))[0]
        assert np.isfinite(values(c)).all()
