"""The reports of the paper's experiments: the answer counted right, the table in its width, the page on its own."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from sccal.experiments.plan import EXPERIMENTS, PATHS, judged_s
from sccal.report.experiments.figures import cell_drawings, convergence, overview_drawing
from sccal.report.experiments.page import experiments_html
from sccal.report.experiments.text import answers, experiments_text, headline, ratio_text, spread_text
from sccal.report.write import write_experiments
from sccal.results.calibration import Estimate, History, Parameters, Trajectory
from sccal.results.converter import document_of, json_text
from sccal.results.experiments import (
    PARAMETERS,
    VARIANTS,
    Cell,
    Experiment,
    Experiments,
    Failed,
    Filtered,
    Spread,
    Trial,
    Variant,
    VariantFigures,
)
from tests.report.pages import assert_page

TRUTH = (0.0808, 0.0796, 0.728, 12.5)
NAN = float("nan")
T_S = np.arange(0.0, 120.0, 0.5)


def filtered(variant: Variant, error_m: np.ndarray) -> Filtered:
    east, north = 10.0 * np.cos(T_S / 20.0) + error_m, 10.0 * np.sin(T_S / 20.0)
    none, ones = np.zeros(T_S.size), np.ones(T_S.size)
    factor = 1.0 if variant == "with" else 0.976
    offset = np.radians(12.0) * ones if variant == "with" else none
    history = History(
        T_S,
        *(factor * value * ones for value in TRUTH[:3]),
        offset,
        *(0.01 * value * ones for value in TRUTH[:3]),
        0.02 * ones,
    )
    estimates = [Estimate(factor * value, 0.001 * value, "estimated") for value in TRUTH[:3]]
    parameters = Parameters(*estimates, Estimate(float(offset[-1]), 0.02, "estimated"))
    path = Trajectory(T_S, east, north, none, none, none, none)
    return Filtered(variant, error_m, float(error_m.mean()), float(error_m[-1]), parameters, path, history)


def figures(trial: Trial, variant: Variant, rms_m: np.ndarray, values: np.ndarray) -> VariantFigures:
    error = trial.of(variant).error_m
    held = "held" if variant == "without" else "estimated"
    low, median, high = (float(x) for x in np.quantile(rms_m, (0.05, 0.5, 0.95)))
    return VariantFigures(
        rms_m=rms_m,
        end_m=0.5 * rms_m,
        values=values,
        sigmas=0.001 * np.abs(values) + 1e-6,
        statuses=tuple(("estimated", "estimated", "estimated", held) for _ in rms_m),
        error_over_time_m=(error, 0.5 * error, 2.0 * error),
        rms_spread_m=Spread(median, low, high),
        end_spread_m=Spread(0.5 * median, 0.5 * low, 0.5 * high),
    )


def cell(
    experiment: Experiment = EXPERIMENTS[0],
    path: str = "general",
    ratio: float = 8.0,
    seeds: int = 3,
    measured: bool = False,
    off_percent: float = 0.1,
) -> Cell:
    """Errors of 0.2 m with and ratio times as much without; the radii and the track so many percent too long."""
    begin, end = judged_s(experiment, (0.0, float(T_S[-1])))
    judged = (begin < T_S) & (end >= T_S)
    error = np.where(judged, 0.2, 0.01) * (1.0 + 0.2 * np.sin(T_S))
    trial = Trial(
        t_s=T_S,
        true_east_m=10.0 * np.cos(T_S / 20.0),
        true_north_m=10.0 * np.sin(T_S / 20.0),
        judged=judged,
        fix_t_s=T_S,
        fix_east_m=10.0 * np.cos(T_S / 20.0) + 0.01,
        fix_north_m=10.0 * np.sin(T_S / 20.0),
        filtered=(filtered("without", ratio * error), filtered("with", error)),
        true_parameters=(*TRUTH[:3], float(np.radians(TRUTH[3]))),
        offset_wander_rad=None if measured else 0.03 * np.sin(T_S / 30.0),
    )
    spread = np.linspace(0.9, 1.1, seeds)
    values = np.outer(np.ones(seeds), TRUTH) * (1.0 + 0.01 * off_percent)
    bare = values * [0.976, 0.976, 0.976, 0.0]
    inside = abs(off_percent) <= 1.0
    return Cell(
        experiment=experiment,
        path=path,
        measured=measured,
        seeds=tuple(range(1, seeds + 1)),
        t_s=T_S,
        judged=judged,
        figures={
            "without": figures(trial, "without", 0.2 * ratio * spread, bare),
            "with": figures(trial, "with", 0.2 * spread, values),
        },
        ratio=Spread(ratio, *((0.5 * ratio, 2.0 * ratio) if seeds > 1 else (NAN, NAN))),
        truth=TRUTH,
        errors_percent=np.full((seeds, 3), off_percent),
        within_percent=seeds if inside else 0,
        why_not="" if inside else "track: this drive and these fixes give ± 2.4 %; each within 3 of its own sigmas",
        shown=trial,
    )


def all_cells(**changes: float) -> Experiments:
    cells = [
        cell(x, path, 4.0 + k + 3.0 * n, **changes) for n, x in enumerate(EXPERIMENTS) for k, path in enumerate(PATHS)
    ]  # type: ignore[arg-type]
    return Experiments(tuple(cells), 120.0, (1, 2, 3))


ALL = all_cells()
FEW = Experiments(
    (ALL.cells[0], ALL.cells[2], ALL.cells[5], cell(EXPERIMENTS[1], "yard", measured=True)), 120.0, (1, 2, 3)
)
"""Fewer figures to draw: a rectangle, two general paths, a measured run."""


@pytest.fixture(scope="module")
def page() -> str:
    return experiments_html(FEW)


def assert_numbers(html: str) -> None:
    assert_page(html)
    assert "nan" not in re.sub(r"<svg.*?</svg>", "", html, flags=re.DOTALL)


def test_the_json_has_every_seed_and_is_strict() -> None:
    document = json.loads(json_text(document_of(ALL)), parse_constant=pytest.fail)
    assert document["schema"] == "sccal.experiments/1"
    assert (document["duration_s"], document["seeds"], document["tolerance_percent"]) == (120.0, [1, 2, 3], 1.0)
    assert len(document["cells"]) == 9
    for one, source in zip(document["cells"], ALL.cells, strict=True):
        assert (one["experiment"], one["path"]) == (source.experiment.key, source.path)
        assert one["ratio"] == {"mean": source.ratio.median, "interval_95": [source.ratio.low, source.ratio.high]}
        assert set(one["variants"]) == {"sc_ekf", "sc_ekf_offset"}
        for key, variant in (("sc_ekf", "without"), ("sc_ekf_offset", "with")):
            own = source.figures[variant]  # type: ignore[index]
            assert one["variants"][key]["rms_m"] == own.rms_m.tolist()
            assert one["variants"][key]["rms_5_95_m"] == [own.rms_spread_m.low, own.rms_spread_m.high]
            assert set(one["variants"][key]["parameters"]) == set(PARAMETERS)
            assert len(one["variants"][key]["parameters"]["track_m"]["status"]) == 3
        assert one["truth"] == dict(zip(PARAMETERS, TRUTH, strict=True))
        assert one["errors_percent"]["track_m"] == [0.1, 0.1, 0.1]
        assert one["within_percent"] == 3
    loss, noise = document["cells"][0]["fault"], document["cells"][8]["fault"]
    assert (loss["kind"], loss["sigma_m"], loss["quality"]) == ("loss", None, None)
    assert (noise["kind"], noise["sigma_m"], noise["quality"]) == ("noise", 5.0, 1)
    assert loss["from_s"] == pytest.approx(60.0, abs=0.6)
    assert loss["to_s"] == pytest.approx(83.5, abs=0.6)


def test_one_seed_has_no_interval_and_unknown_truth_no_errors() -> None:
    alone = replace(cell(seeds=1), truth=None, errors_percent=np.zeros((0, 3)), within_percent=0)
    (one,) = document_of(Experiments((alone,), 120.0, (1,)))["cells"]
    assert one["ratio"]["interval_95"] == [None, None]
    assert one["truth"] is None
    assert one["within_percent"] is None
    assert one["errors_percent"] == {"radius_right_m": [], "radius_left_m": [], "track_m": []}
    text = experiments_text(Experiments((alone,), 120.0, (1,)))
    assert "95 % interval of that ratio" not in text
    assert "nan" not in text
    assert_numbers(experiments_html(Experiments((alone,), 120.0, (1,))))


def test_the_answer_counts_cells_and_trials() -> None:
    better, true = answers(ALL)
    assert "in all 9 cells with simulated drives" in better
    assert "4.0 (2.0–8.0) to 12 (6.0–24) times" in better
    assert "above 1 in all 9" in better
    assert true == "With it both radii and the track end within 1 % of the truth in all 27 trials."
    assert headline(ALL).endswith("in all 9 cells")


def test_a_cell_that_is_worse_is_named() -> None:
    mixed = Experiments((cell(), cell(path="circle", ratio=0.8)), 120.0, (1, 2, 3))
    better = answers(mixed)[0]
    assert "in 1 of 2 cells" in better
    assert "not better: circle, fixes lost" in better
    assert headline(mixed).endswith("in 1 of 2 cells")


def test_parameters_beyond_the_tolerance_come_with_their_reason() -> None:
    far = Experiments((cell(), cell(path="circle", off_percent=2.0)), 120.0, (1, 2, 3))
    assert "in 3 of 6 trials; the others are of circle" in answers(far)[1]
    for text in (experiments_text(far), experiments_html(far)):
        flat = " ".join(text.replace("\u00a0", " ").split())
        assert "this drive and these fixes give ± 2.4 %" in flat


def test_measured_runs_answer_for_themselves() -> None:
    both = Experiments((cell(), cell(path="yard/run", measured=True, ratio=30.0)), 120.0, (1, 2, 3))
    texts = answers(both)
    assert "cells with simulated drives" in texts[0]
    assert "8.0 (4.0–16) times" in texts[0]
    assert "cells with measured runs" in texts[2]
    assert "what the undisturbed run gives" in texts[3]


@pytest.mark.parametrize("width", [120, 100, 80, 60, 50])
def test_the_table_keeps_its_width_and_all_drives(width: int) -> None:
    long = cell(path="field/2024-08-05-14-45-26-behind-the-barn", measured=True, ratio=133.6)
    text = experiments_text(Experiments((*ALL.cells, long), 120.0, (1, 2, 3)), width)
    assert max(map(len, text.splitlines())) <= width
    for path in PATHS:
        assert len(re.findall(rf"^  {path} .*3/3$", text, re.MULTILINE)) == 3
    assert ("end without" in text) == (width >= 100)
    assert "magnetometer's offset" in " ".join(text.split())
    assert "12.5 deg" in " ".join(text.split())


def test_failed_runs_are_told() -> None:
    failed = (Failed("yard/<b>", "run.nmea has no fix; record one"),)
    told = Experiments(ALL.cells[:1], 120.0, (1, 2, 3), failed)
    assert "yard/<b>: run.nmea has no fix; record one" in experiments_text(told)
    assert "yard/&lt;b&gt;" in experiments_html(told)
    assert document_of(told)["failed"] == [{"name": "yard/<b>", "reason": "run.nmea has no fix; record one"}]


def test_numbers_of_any_size_stay_short() -> None:
    assert spread_text(Spread(0.543, 0.331, 0.755)) == "0.54 (0.33–0.76)"
    assert spread_text(Spread(12.34, 12.34, 12.34)) == "12.3"
    assert ratio_text(Spread(5.05, 0.00098, 26094.9)) == "5.0 (<0.01–>9999)"
    assert ratio_text(Spread(133.6, NAN, NAN)) == "134"


def test_the_page_has_each_cell_and_convergence_where_the_paper_has_it(page: str) -> None:
    assert_numbers(page)
    assert len(page.encode()) < 1_000_000
    assert page.count("<svg") == 1 + 4 * 3 + 3
    ids = re.findall(r'<(?:figure|section|h3) id="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    assert [i for i in ids if i.endswith("convergence")] == [
        "gps_loss-2-convergence", "lowered_quality-1-convergence", "lowered_quality-2-convergence",
    ]  # fmt: skip
    for words in ("keeps the whole offset of 12.5\u00a0deg", "what the paper's SC EKF faces", "σ\u00a03\u00a0deg"):
        assert words in page


def test_measured_and_ugly_cells_are_drawn() -> None:
    ugly = cell(path='<script>"&', measured=True, seeds=1, off_percent=40.0)
    no_fix = replace(ugly.shown, fix_t_s=np.empty(0), fix_east_m=np.empty(0), fix_north_m=np.empty(0))
    ugly = replace(ugly, shown=no_fix)
    assert_numbers(experiments_html(Experiments((ugly,), 120.0, (1,))))
    assert [d.name for d in cell_drawings(ugly, "x")] == ["x-path", "x-error", "x-parameters", "x-convergence"]


def test_a_variant_that_is_far_off_does_not_flatten_the_other() -> None:
    near = cell()
    history = near.shown.of("without").history
    lost = replace(near.shown.of("without"), history=replace(history, track_m=history.track_m * 50.0))
    far = replace(near, shown=replace(near.shown, filtered=(lost, near.shown.of("with"))))
    assert convergence(far).count("far off") == convergence(near).count("far off") + 1


def test_no_cell_still_has_a_page_and_a_text() -> None:
    nothing = Experiments((), 120.0, (1,), (Failed("a", "b"),))
    assert overview_drawing(nothing) is None
    assert_numbers(experiments_html(nothing))
    assert "Nothing was tried that gave a result." in experiments_text(nothing)


def test_every_figure_is_well_formed_and_the_same_each_time() -> None:
    for one in (cell(), cell(EXPERIMENTS[1])):
        drawings = cell_drawings(one, "x")
        assert [d.svg for d in drawings] == [d.svg for d in cell_drawings(one, "x")]
        for drawing in drawings:
            ElementTree.fromstring(drawing.svg)
            assert len(drawing.svg) < 130_000, drawing.name


def test_files_are_written_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    few = Experiments(ALL.cells[:1], 120.0, (1, 2, 3))
    page = write_experiments(few, tmp_path / "new" / "out")
    assert page.name == "experiments.html"
    assert sorted(p.name for p in page.parent.iterdir()) == ["experiments.html", "experiments.json"]
    before = page.read_text(encoding="utf-8")
    monkeypatch.setattr("pathlib.Path.replace", lambda *_: (_ for _ in ()).throw(OSError("disk full")))
    with pytest.raises(OSError, match="disk full"):
        write_experiments(few, page.parent)
    assert sorted(p.name for p in page.parent.iterdir()) == ["experiments.html", "experiments.json"]
    assert page.read_text(encoding="utf-8") == before


def test_both_variants_are_in_every_cell() -> None:
    assert {v for one in ALL.cells for v in one.figures} == set(VARIANTS)
