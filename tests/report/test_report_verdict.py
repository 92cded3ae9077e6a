"""The verdict follows from statuses and figures of fit."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from sccal.calibration.verdict import judged_run, judged_vehicle, run_verdict, vehicle_verdict
from sccal.report.fleet.junit import junit_xml
from sccal.report.fleet.step_summary import step_summary
from sccal.report.run.page import run_html
from sccal.report.run.text import run_text
from sccal.report.vehicle.text import vehicle_text
from sccal.results.calibration import Calibration, Missing, Status, VehicleCalibration
from sccal.results.converter import document_of
from sccal.results.gates import BatchOutcome


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


ARM = Missing("lever_arm", "antenna off the middle between the wheels", 812.4, 8.0)
SLIP = Missing("turn_slip", "tracks that skid sideways in turns, more in fast ones", 61.2, 1.4)


def test_what_the_model_lacks_is_a_doubt(a_run: Calibration) -> None:
    verdict = run_verdict(replace(a_run, missing=(ARM, SLIP)))
    assert verdict.level == "doubtful"
    assert verdict.because == (f"`sccal diagnose` would name {ARM.title} and {SLIP.title}",)
    several = tuple(replace(ARM, effect=str(k), title=f"effect {k}") for k in range(5))
    assert str(run_verdict(replace(a_run, missing=several))).endswith("effect 0, effect 1, effect 2 and 2 more effects")


def test_what_one_run_shows_missing_is_the_vehicle_s_doubt(a_run: Calibration, a_vehicle: VehicleCalibration) -> None:
    weaker = replace(ARM, evidence_nats=30.0)
    runs = (replace(a_run, missing=(weaker,)), replace(a_run, missing=(SLIP, ARM)), a_run)
    vehicle = judged_vehicle(replace(a_vehicle, runs=runs, consistency_chi2_per_dof=1.0))
    assert vehicle.verdict.because == (f"`sccal diagnose` would name {ARM.title} and {SLIP.title}",)
    assert document_of(vehicle)["missing"][0] == {
        "effect": "lever_arm", "title": ARM.title, "evidence_nats": 812.4, "size": 8.0
    }  # fmt: skip
    text = " ".join(vehicle_text(vehicle, 100).split())
    assert "lacks by a quick look, lever_arm (evidence 812 nats, 8.0 times the size that matters), turn_slip" in text


def test_what_the_model_lacks_is_told_wherever_the_run_is(a_run: Calibration) -> None:
    lacking = judged_run(replace(a_run, missing=(ARM,)))
    assert document_of(lacking)["missing"] == [
        {"effect": "lever_arm", "title": ARM.title, "evidence_nats": 812.4, "size": 8.0}
    ]
    assert document_of(lacking)["verdict"].startswith("doubtful: `sccal diagnose` would name antenna off")
    html = run_html(lacking)
    assert ARM.title in html
    assert "sccal calibrate … --model OUT/model.json" in html
    assert "lacks    by a quick look, lever_arm" in run_text(lacking, 100)
    outcome = BatchOutcome((lacking,), {}, (), ())
    assert f"lever\\_arm: {ARM.title}" in step_summary(outcome)
    assert f"would name {ARM.title}" in junit_xml(outcome)


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
