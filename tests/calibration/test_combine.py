"""Several runs of one vehicle: one problem, the prior counted once, disagreement told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sccal.calibration.combine import combine
from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from sccal.results.calibration import Estimate
from tests.calibration.test_single import GIVEN, NAMES, estimates, truth
from tests.runs import read, written


def calibrated(folder, **options):
    return calibrate_run(read(folder), CalibrationOptions(**options))


def joined(pairs):
    return combine([one for one, _ in pairs], [problem for _, problem in pairs])


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    root = tmp_path_factory.mktemp("runs")
    paths = ("general", "rectangle", "circle")
    return [written(root / path, path=path, duration_s=200, seed=40 + k) for k, path in enumerate(paths)]


def test_shared_parameters_are_surer_than_any_run_and_right(folders):
    pairs = [calibrated(folder) for folder in folders]
    vehicle = joined(pairs)
    true = truth(folders[0])
    for k, name in enumerate(NAMES[:3]):
        one = getattr(vehicle.parameters, name)
        alone = min(getattr(run.parameters, name).sigma for run, _ in pairs)
        assert abs(one.value - true[k]) < 3.5 * one.sigma
        assert one.sigma < 1.6 * alone
        assert one.status == "estimated"
    assert vehicle.consistency_chi2_per_dof < 4.0
    assert len(vehicle.outage.windows) == sum(len(run.outage.windows) for run, _ in pairs)


def test_the_same_run_twice_is_half_the_variance_and_the_same_value(folders):
    pair = calibrated(folders[0], noise=GIVEN)
    other = (replace(pair[0], run="again"), pair[1])
    vehicle = joined([pair, other])
    for name in NAMES[:3]:
        one, both = getattr(pair[0].parameters, name), getattr(vehicle.parameters, name)
        assert both.value == pytest.approx(one.value, abs=0.02 * one.sigma)
        assert both.sigma == pytest.approx(one.sigma / np.sqrt(2.0), rel=0.02)
    assert vehicle.consistency_chi2_per_dof == pytest.approx(0.0, abs=0.02)


def test_one_run_is_its_own_vehicle(folders):
    run, problem = calibrated(folders[0], noise=GIVEN)
    assert joined([(run, problem)]).parameters == run.parameters


def test_offsets_belong_to_their_runs(tmp_path):
    pairs = [
        calibrated(
            written(tmp_path / name, f"ahrs.heading_offset_deg={offset}", duration_s=150, seed=seed), noise=GIVEN
        )
        for name, offset, seed in (("a", 12.5, 1), ("b", 137.0, 2))
    ]
    vehicle = joined(pairs)
    assert vehicle.parameters.heading_offset_rad.status == "unobserved"
    assert "belongs to each run" in vehicle.parameters.heading_offset_rad.reason
    assert vehicle.parameters.track_m.status == "estimated"


def test_offsets_on_both_sides_of_half_a_turn_are_neighbours(tmp_path):
    pairs = [
        calibrated(
            written(tmp_path / name, f"ahrs.heading_offset_deg={offset}", duration_s=150, seed=seed), noise=GIVEN
        )
        for name, offset, seed in (("a", 179.8, 1), ("b", -179.9, 2))
    ]
    offset = joined(pairs).parameters.heading_offset_rad
    assert offset.status == "estimated"
    assert abs(abs(np.degrees(offset.value)) - 180.0) < 1.0


def test_runs_that_disagree_widen_the_sigmas_and_are_told(tmp_path):
    pairs = [
        calibrated(written(tmp_path / name, f"vehicle.radius_right_m={radius}", duration_s=150, seed=seed), noise=GIVEN)
        for name, radius, seed in (("a", 0.0808, 1), ("b", 0.0812, 2), ("c", 0.0806, 3))
    ]
    vehicle = joined(pairs)
    assert vehicle.consistency_chi2_per_dof > 3.0
    radius = vehicle.parameters.radius_right_m
    assert radius.sigma > 1e-4
    assert abs(radius.value - 0.08087) < 3 * radius.sigma
    assert any("disagree" in str(notice) for notice in vehicle.notices)
    assert all(one.sigma < 1e-4 for run, _ in pairs for one in estimates(run)[:2])


def with_offset(run, value_deg, sigma_deg, status):
    offset = Estimate(np.radians(value_deg), np.radians(sigma_deg), status, "why" * (status != "estimated"))
    return replace(run, parameters=replace(run.parameters, heading_offset_rad=offset))


def test_a_run_that_does_not_show_its_offset_takes_no_part_in_the_vehicles(tmp_path):
    run, problem = calibrate_run(read(written(tmp_path / "run", duration_s=60.0)), CalibrationOptions())
    runs = [with_offset(run, 12.0, 0.2, "estimated"), with_offset(run, 12.2, 0.2, "estimated")]
    lost = with_offset(run, 31.0, 19.0, "unobserved")
    offset = combine([*runs, lost], [problem] * 3).parameters.heading_offset_rad
    assert offset.status == "estimated"
    assert np.degrees(offset.value) == pytest.approx(12.1, abs=0.01)
    assert (
        combine([runs[0], lost], [problem] * 2).parameters.heading_offset_rad == runs[0].parameters.heading_offset_rad
    )
    alone = combine([lost, lost], [problem] * 2).parameters.heading_offset_rad
    assert (alone.status, alone.reason) == ("unobserved", "why")
