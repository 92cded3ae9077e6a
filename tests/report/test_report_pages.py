"""The pages: self-contained, escaped, deterministic, small, and drawn for every kind of run."""

from __future__ import annotations

import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np

from sccal.calibration.verdict import run_verdict
from sccal.report.drawing.plan import drawn
from sccal.report.drawing.style import thinned
from sccal.report.run.advice import advice_on
from sccal.report.run.figure_outage import outage_plan
from sccal.report.run.figures import run_drawings
from sccal.report.run.page import run_html
from sccal.report.vehicle.page import vehicle_html
from sccal.results.calibration import (
    Calibration,
    Estimate,
    Fixes,
    History,
    InputFile,
    Provenance,
    Residuals,
    Trajectory,
    VehicleCalibration,
)
from tests.report.pages import assert_page


def empty(c: Calibration) -> Calibration:
    none = np.empty(0)
    nobody = np.empty(0, dtype=bool)
    return replace(
        c,
        trajectory=Trajectory(*[none] * 7),
        history=History(*[none] * 9),
        residuals=Residuals(none, none, none, nobody, none, none, none, none, none, nobody),
        fixes=Fixes(none, none, none, np.empty(0, dtype=np.int64)),
        causes=(),
        consistency=(),
        manoeuvres=(),
    )


def test_a_run_s_page(a_run: Calibration) -> None:
    html = run_html(a_run)
    assert_page(html)
    assert html.count("<svg") == 6
    assert "0.080831 ± 0.000012 m" in html
    assert "drift by what was learnt so far: 0.12 m rms after 30 s without fixes" in html


def test_an_ugly_run_s_page_gives_reasons_and_no_empty_figure(an_ugly_run: Calibration) -> None:
    html = run_html(an_ugly_run)
    assert_page(html)
    assert html.count("<svg") == 5
    assert "drive circles to both sides" in html
    assert "no window of 30 s fits" in html


def test_a_run_without_a_single_point_still_has_a_page(a_run: Calibration) -> None:
    assert_page(run_html(empty(a_run)))


def test_nan_anywhere_is_drawn_around(an_ugly_run: Calibration) -> None:
    holes = an_ugly_run.history.track_m.copy()
    holes[::3] = np.nan
    east = an_ugly_run.residuals.fix_east_m.copy()
    east[:100] = np.nan
    gone = np.full_like(holes, np.nan)
    holed = replace(
        an_ugly_run,
        history=replace(an_ugly_run.history, track_m=holes, heading_offset_rad=gone),
        residuals=replace(an_ugly_run.residuals, fix_east_m=east),
    )
    assert_page(run_html(holed))


def test_names_and_reasons_are_escaped(an_ugly_run: Calibration) -> None:
    evil = "<script>alert(1)</script>"
    track = replace(an_ugly_run.parameters.track_m, reason=evil, status="unobserved")
    html = run_html(replace(an_ugly_run, run=evil, parameters=replace(an_ugly_run.parameters, track_m=track)))
    assert "<script" not in html
    assert "&lt;script&gt;" in html


def test_the_vehicle_s_page_links_to_its_runs(a_vehicle: VehicleCalibration) -> None:
    odd = replace(a_vehicle.runs[0], run="yard/a b#1")
    html = vehicle_html(replace(a_vehicle, runs=(odd, *a_vehicle.runs[1:])))
    assert_page(html)
    assert 'href="./yard/a%20b%231/report.html"' in html
    assert 'href="./yard/square/report.html"' in html
    assert 'href="vehicle.json"' in html


def test_the_same_result_gives_the_same_bytes(an_ugly_run: Calibration) -> None:
    assert [d.svg for d in run_drawings(an_ugly_run)] == [d.svg for d in run_drawings(an_ugly_run)]


def test_an_hour_s_figures_stay_small_and_well_formed(an_hour: Calibration) -> None:
    for drawing in run_drawings(an_hour):
        assert len(drawing.svg) < 400_000, drawing.name
        ElementTree.fromstring(drawing.svg)


def test_figures_keep_the_decimals_of_their_text(a_run: Calibration, a_vehicle: VehicleCalibration) -> None:
    drift = next(drawing.svg for drawing in run_drawings(a_run) if drawing.name == "outage")
    assert "rms at the end: 0.12 m" in drift
    ticks = re.findall(r">(0\.0\d+)</text>", vehicle_html(a_vehicle))
    assert any(len(tick) > len("0.00") for tick in ticks)


def test_provenance_stands_on_the_page_where_it_is_known(a_run: Calibration) -> None:
    assert "Provenance" not in run_html(a_run)
    digest = "0123456789abcdef" * 4
    made = Provenance(
        (InputFile("encoder.csv", 123456, digest),), {"outage_window_s": "30"}, {"sccal": "0.1.0", "numpy": "2.0"}
    )
    html = run_html(replace(a_run, provenance=made, started="2026-05-28T20:26:40Z"))
    assert_page(html)
    for told in (digest, "123456", "outage_window_s = 30", "numpy 2.0", "2026-05-28 20:26 UTC"):
        assert told in html


def test_the_page_says_what_was_not_driven(a_run: Calibration) -> None:
    html = run_html(a_run)
    for kind in ("straight back", "arcs to the right", "turns in place, left"):
        assert re.search(rf'{kind}</th><td class="n" data-label="time">none<', html)
    assert re.search(r'arcs to the left</th><td class="n" data-label="time">93 s<', html)


def test_a_residual_that_follows_something_is_named(a_run: Calibration) -> None:
    svg = next(drawing.svg for drawing in run_drawings(a_run) if drawing.name == "causes")
    assert svg.count("up to 0.0075 m") == 1
    assert "up to" not in svg.replace("up to 0.0075 m", "")


def test_a_run_of_which_nothing_may_be_used_is_called_unusable(a_run: Calibration) -> None:
    def unseen(one: Estimate) -> Estimate:
        return replace(one, status="unobserved", reason="drive circles")

    p = a_run.parameters
    none = replace(
        p,
        radius_right_m=unseen(p.radius_right_m),
        radius_left_m=unseen(p.radius_left_m),
        track_m=unseen(p.track_m),
        heading_offset_rad=unseen(p.heading_offset_rad),
    )
    bad = replace(a_run, parameters=none)
    assert advice_on(bad, run_verdict(bad)).level == "unusable"
    assert run_verdict(bad).level == "doubtful"
    assert "drive circles" in advice_on(bad, run_verdict(bad)).next_step
    some = replace(a_run, parameters=replace(p, track_m=unseen(p.track_m)))
    advice = advice_on(some, run_verdict(some))
    assert advice.level == "partial"
    assert "use right radius, left radius and heading offset, not track" in advice.title
    assert advice_on(a_run, run_verdict(a_run)).level == "good"
    assert "subtract the heading offset" in advice_on(a_run, run_verdict(a_run)).next_step
    without = replace(a_run, with_offset=False, parameters=replace(p, heading_offset_rad=unseen(p.heading_offset_rad)))
    assert "heading offset" not in advice_on(without, run_verdict(without)).next_step


def test_an_outage_without_windows_can_be_drawn(an_ugly_run: Calibration) -> None:
    ElementTree.fromstring(drawn(outage_plan(an_ugly_run.outage)).svg)


def test_thinning_keeps_extremes_and_ends() -> None:
    values = np.random.default_rng(0).normal(size=100_003)
    values[[17, 99_999]] = 50.0, -50.0
    kept = thinned(values, 1000)
    assert len(kept) <= 1000
    assert (np.diff(kept) > 0).all()
    assert {0, 17, 99_999, 100_002} <= set(kept.tolist())
