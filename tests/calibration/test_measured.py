"""Measured logs, where they lie beside the checkout."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sccal.calibration.combine import combine
from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from sccal.logs.run import discover, read_run

LOGS = Path(__file__).resolve().parents[2].parent / "shared" / "logs"

pytestmark = [
    pytest.mark.measured,
    pytest.mark.skipif(not LOGS.is_dir(), reason="measured logs are not beside the checkout"),
]


@pytest.fixture(scope="module")
def van():
    pairs = [calibrate_run(read_run(source), CalibrationOptions()) for source in discover([LOGS / "psu-van"])]
    return combine([run for run, _ in pairs], [problem for _, problem in pairs])


def test_every_run_of_the_van_gives_its_radii_and_offset(van):
    assert len(van.runs) == 7
    for run in van.runs:
        p = run.parameters
        assert 0.345 < p.radius_right_m.value < 0.355
        assert 0.345 < p.radius_left_m.value < 0.355
        assert np.degrees(p.heading_offset_rad.value) == pytest.approx(-8.9, abs=0.4)
        assert 1.3 < p.track_m.value < 2.6
        assert len(run.outage.windows) >= 2


def test_the_van_as_one_vehicle(van):
    p = van.parameters
    assert 0.345 < p.radius_right_m.value < 0.355
    assert 0.345 < p.radius_left_m.value < 0.355
    assert np.degrees(p.heading_offset_rad.value) == pytest.approx(-8.9, abs=0.4)
    assert van.outage.end_rms_m < 4.0


def test_laps_one_way_and_the_other_disagree_and_that_is_told(van):
    """The antenna stands 0.74 m off the middle, which this model lacks."""
    assert van.consistency_chi2_per_dof > 10.0
    assert van.parameters.radius_right_m.sigma > 1e-4


def test_the_husky_is_calibrated_in_spite_of_its_compass():
    (source,) = discover([LOGS / "husky"])
    run, _ = calibrate_run(read_run(source), CalibrationOptions())
    assert 0.85 < run.parameters.radius_right_m.value < 1.05
    assert run.noise.heading_coloured_rad > np.radians(1.0)
    assert run.parameters.heading_offset_rad.sigma > np.radians(0.5)
