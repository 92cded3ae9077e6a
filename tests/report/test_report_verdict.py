"""The verdict follows from statuses and figures of fit."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from sccal.calibration.result import Calibration, Status, VehicleCalibration
from sccal.report.verdict import run_verdict, vehicle_verdict


def with_status(c: Calibration, status: Status, *names: str) -> Calibration:
    changed = {name: replace(getattr(c.parameters, name), status=status) for name in names}
    return replace(c, parameters=replace(c.parameters, **changed))


def test_good(a_run: Calibration) -> None:
    assert str(run_verdict(a_run)) == (
        "good: all four parameters estimated, predictions consistent with the measurements"
    )


def test_the_offset_counts_only_where_it_is_a_state(a_run: Calibration) -> None:
    held = with_status(a_run, "held", "heading_offset_rad")
    assert str(run_verdict(held)) == "partial: heading_offset_deg held"
    assert str(run_verdict(replace(held, with_offset=False))).startswith("good: all three parameters")


def test_partial(a_run: Calibration) -> None:
    assert str(run_verdict(with_status(a_run, "unobserved", "track_m"))) == "partial: track_m not observed"


def test_a_bound_is_a_doubt(a_run: Calibration) -> None:
    assert str(run_verdict(with_status(a_run, "at_bound", "track_m"))) == "doubtful: track_m at its bound"


def test_nothing_observed_is_a_doubt(a_run: Calibration) -> None:
    nothing = with_status(a_run, "unobserved", "radius_right_m", "radius_left_m", "track_m", "heading_offset_rad")
    assert str(run_verdict(nothing)) == "doubtful: no parameter could be estimated"


@pytest.mark.parametrize(
    ("fit", "words"),
    [
        ({"nis_gnss": 3.2}, "fixes do not fit their noise (NIS 3.2, consistent is 1)"),
        ({"nis_heading": 0.21}, "headings do not fit their noise (NIS 0.21, consistent is 1)"),
        ({"nis_gnss": math.nan}, "fixes do not fit their noise (NIS n/a, consistent is 1)"),
        ({"fixes_used": 70, "fixes_rejected": 30}, "30 % of the fixes rejected"),
        ({"headings_used": 0, "headings_rejected": 0}, "no headings"),
    ],
)
def test_a_bad_fit_is_a_doubt(a_run: Calibration, fit: dict[str, Any], words: str) -> None:
    verdict = run_verdict(replace(a_run, fit=replace(a_run.fit, **fit)))
    assert (verdict.level, verdict.because) == ("doubtful", (words,))


def test_runs_that_disagree_are_a_doubt(a_vehicle: VehicleCalibration) -> None:
    assert vehicle_verdict(a_vehicle).level == "good"
    apart = replace(a_vehicle, consistency_chi2_per_dof=8.41)
    assert str(vehicle_verdict(apart)) == "doubtful: the runs disagree about the shared parameters (chi2 per dof 8.41)"
