"""The pages: self-contained, escaped, deterministic, small, and drawn for every kind of run."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from xml.etree import ElementTree

import numpy as np

from sccal.calibration.result import Calibration, Fixes, History, Residuals, Trajectory, VehicleCalibration
from sccal.report.figures import outage_drift, path_map, run_drawings, thinned
from sccal.report.html import run_html, vehicle_html

VOID = {"meta", "br", "link", "img", "hr", "input"}


class Balance(HTMLParser):
    """Fails on tags that do not close in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def assert_page(html: str) -> None:
    balance = Balance()
    balance.feed(html)
    assert balance.open == []
    for reference in re.findall(r'(?:src|href)="([^"]*)"', html):
        assert not re.match(r"[a-z]+:|//", reference), f"{reference} is not in the page"
    assert "<script" not in html
    assert len(html.encode()) < 3_000_000


def empty(c: Calibration) -> Calibration:
    none = np.empty(0)
    nobody = np.empty(0, dtype=bool)
    return replace(
        c,
        trajectory=Trajectory(*[none] * 7),
        history=History(*[none] * 9),
        residuals=Residuals(none, none, none, nobody, none, none, none, none, none, nobody),
        fixes=Fixes(none, none, none, np.empty(0, dtype=np.int64)),
    )


def test_a_run_s_page(a_run: Calibration) -> None:
    html = run_html(a_run)
    assert_page(html)
    assert html.count("<svg") == 4
    assert "0.080831 ± 0.000012 m" in html
    assert "drift after 30 s without fixes: 0.12 m rms" in html


def test_an_ugly_run_s_page_gives_reasons_and_no_empty_figure(an_ugly_run: Calibration) -> None:
    html = run_html(an_ugly_run)
    assert_page(html)
    assert html.count("<svg") == 3
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


def test_glyphs_keep_their_scale(an_ugly_run: Calibration) -> None:
    assert "scale(0.015625)" in path_map(an_ugly_run)


def test_an_outage_without_windows_can_be_drawn(an_ugly_run: Calibration) -> None:
    ElementTree.fromstring(outage_drift(an_ugly_run.outage))


def test_thinning_keeps_extremes_and_ends() -> None:
    values = np.random.default_rng(0).normal(size=100_003)
    values[[17, 99_999]] = 50.0, -50.0
    kept = thinned(values, 1000)
    assert len(kept) <= 1000
    assert (np.diff(kept) > 0).all()
    assert {0, 17, 99_999, 100_002} <= set(kept.tolist())
