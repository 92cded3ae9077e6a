"""index.html, summary.csv and summary.json: complete, safe, small, and the same bytes for the same results."""

import csv
import io
import json
import re
from dataclasses import dataclass, replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sccal.errors import DataError, Failure, SccalError
from sccal.logs.streams import Notice
from sccal.report.fleet.figures import PATH_UNITS, control_chart, path_strokes
from sccal.report.fleet.lines import change_sentence, changes, headline, with_sentences
from sccal.report.fleet.page import index_html
from sccal.report.fleet.table import FORMULA_MARKS, summary_csv
from sccal.report.write import write_summary
from sccal.results.calibration import VEHICLE_RUN
from sccal.results.converter import document_of
from sccal.results.summary import ThinPath
from sccal.results.verdict import Verdict
from sccal.summary.summarise import summarise as summarised
from tests.report.pages import assert_page
from tests.results.documents import retold
from tests.summary.fleets import estimate, history, of_vehicle, with_parameter, written

FAILURES = [Failure("broken", DataError("broken/encoder.csv: is empty")), Failure("=cmd()", SccalError("a bug"))]


@dataclass(frozen=True)
class Gate:
    run: str
    outcome: str
    reason: str = ""
    vehicle: str = "tracked-demo"
    expression: str = "parameters.track_m.sigma<0.01"
    measured: float | None = 0.02
    threshold: float | None = 0.01


def summarise(runs, vehicles=None, failures=(), out=Path("out")):
    return with_sentences(summarised(runs, vehicles or {}, failures, out))


def worn(count=12, **more):
    return history(count, change={"radius_left_m": np.linspace(0.0, -4e-4, count)}, **more)


@pytest.fixture(scope="module")
def summary(tmp_path_factory):
    folder = tmp_path_factory.mktemp("batch")
    runs = worn()
    runs[2] = with_parameter(runs[2], "track_m", estimate(0.7, 0.2, "unobserved"))
    runs[2] = replace(runs[2], verdict=Verdict("partial", ("track_m not observed",)))
    runs[3] = replace(runs[3], notices=(Notice("clock", "off by 97 s", 1, "", "warning"), Notice("-", "-", 1)))
    written(runs, folder)
    return summarise(runs, of_vehicle(runs), FAILURES, folder)


class Page(HTMLParser):
    """Tables as rows of cell texts, and every id."""

    def __init__(self):
        super().__init__()
        self.rows, self.ids, self.inside = [], [], False

    def handle_starttag(self, tag, attrs):
        self.ids += [value for name, value in attrs if name == "id"]
        if tag == "tr":
            self.rows.append([])
        self.inside = tag in ("td", "th") or (self.inside and tag not in ("table", "svg"))
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        if tag in ("td", "th"):
            self.inside = False

    def handle_data(self, data):
        if self.inside and self.rows and self.rows[-1]:
            self.rows[-1][-1] += data


def assert_index(html):
    """The table of runs is sorted by a script; a page without runs has none."""
    assert_page(html, scripts=int("<th><button" in html or "<script" in html))


def test_the_page_says_first_what_changes_and_what_failed(summary):
    html = index_html(summary)
    assert_index(html)
    sentence = "The left radius of tracked-demo has been shrinking since 2026-05-03: -0."
    assert html.index(sentence) < html.index("broken/encoder.csv: is empty") < html.index("<table id=")
    assert "<b>11</b> good" in html
    assert "<b>2</b> failed" in html
    assert html.count('<svg viewBox="0 0 1000 1000"') == 12


def test_every_run_stands_in_the_table_with_its_numbers_and_link(summary):
    html = index_html(summary)
    page = Page()
    page.feed(html)
    rows = {row[0]: row for row in page.rows if row}
    for run in summary.runs:
        assert f'href="./{run.run}/report.html"' in html
        value = run.parameters["radius_right_m"].value
        assert any(cell.startswith(f"{1000 * value:.3f}"[:6]) for cell in rows[run.run])
    assert "– not observed" in rows["run002"]
    assert "1 warning" in " ".join(rows["run003"])
    assert {len(rows[run.run]) for run in summary.runs} == {12}


def test_cells_are_sorted_by_full_numbers_not_by_their_texts(summary):
    html = index_html(summary)
    keys = [float(key) for key in re.findall(r'class="n" data-v="(7[89]\.\d+)"', html)]
    assert np.allclose(keys, [1000 * run.parameters["radius_left_m"].value for run in summary.runs], rtol=1e-7)


@pytest.mark.parametrize("count", [0, 1, 4])
def test_few_runs_have_a_page_a_table_and_a_document(count, tmp_path):
    few = summarise(history(count), [], FAILURES[:count])
    page = write_summary(few, tmp_path / "new")
    assert_index(page.read_text(encoding="utf-8"))
    assert json.loads((tmp_path / "new/summary.json").read_text(encoding="utf-8"))["totals"]["runs"] == count + min(
        count, 2
    )
    table = list(csv.reader(io.StringIO((tmp_path / "new/summary.csv").read_text(encoding="utf-8"))))
    assert len(table) == 1 + count + min(count, 2)


def test_the_same_results_give_the_same_bytes(summary, tmp_path):
    for name in ("a", "b"):
        write_summary(summary, tmp_path / name)
    for file in ("index.html", "summary.csv", "summary.json"):
        one = (tmp_path / "a" / file).read_bytes()
        assert one == (tmp_path / "b" / file).read_bytes()
        assert str(tmp_path).encode() not in one
    assert sorted(path.name for path in (tmp_path / "a").iterdir()) == ["index.html", "summary.csv", "summary.json"]


def test_a_thousand_runs_make_a_page_below_three_megabytes(tmp_path):
    rng = np.random.default_rng(0)
    thousand = summarise(history(1000), [], [])
    corners = [ThinPath(rng.uniform(0, 99, 100), rng.uniform(0, 99, 100)) for _ in thousand.runs]
    runs = tuple(replace(run, path=path) for run, path in zip(thousand.runs, corners, strict=True))
    assert_index(index_html(replace(thousand, runs=runs)))


def test_names_are_escaped_and_links_quoted():
    evil = "<script>alert(1)</script>"
    runs = history(5, vehicle=evil)
    named = [replace(one, run=f"a b#{k}/{evil}") for k, one in enumerate(runs)]
    html = index_html(
        replace(summarise(named, {}, [Failure(evil, DataError(evil))]), gates=(Gate(evil, "failed", evil, evil, evil),))
    )
    assert_index(html)
    assert "alert(1)</script>" not in html
    assert 'href="./a%20b%230/%3Cscript%3Ealert%281%29%3C/script%3E/report.html"' in html


def test_gates_are_told_with_what_failed_them(summary):
    told = replace(
        summary,
        gates=(Gate("run000", "failed", "0.02 is not < 0.01"), Gate("run001", "passed"), Gate(VEHICLE_RUN, "skipped")),
    )
    html = index_html(told)
    assert_index(html)
    assert "1 passed, 1 failed, 1 skipped" in html
    assert "run000: 0.02 is not &lt; 0.01" in html
    assert [gate["outcome"] for gate in document_of(told)["gates"]] == ["failed", "passed", "skipped"]


def test_the_document_holds_what_the_files_held(summary):
    document = json.loads(json.dumps(document_of(summary), allow_nan=False))
    assert document["schema"] == "sccal.summary/1"
    assert document["totals"] == {
        "runs": 14, "good": 11, "partial": 1, "doubtful": 0, "failed": 2, "duration_s": 3600.0, "distance_m": 1920.0,
    }  # fmt: skip
    first = document["runs"][0]
    assert first["results"] == first["run"] == "run000"
    assert first["started"] == "2026-05-03T09:30:00Z"
    assert first["parameters"]["track_m"]["value"] == summary.runs[0].parameters["track_m"].value
    assert first["inputs"] == [{"name": "run000/encoder.csv", "sha256": "ab" * 32}]
    assert first["outage"] == {
        "window_s": 30.0, "windows": 8, "rms_m": 0.06, "end_rms_m": 0.08, "percent_of_distance": 0.4,
    }  # fmt: skip
    assert document["runs"][3]["warnings"] == ["clock: 1 off by 97 s"]
    assert document["failures"][1] == {"run": "broken", "reason": "broken/encoder.csv: is empty", "exit_code": 3}
    told = {one["parameter"]: one["change"] for one in document["vehicles"][0]["trends"]}
    assert told["radius_left_m"]["sentence"] in changes(summary)
    assert told["radius_left_m"]["value"] < 0.0
    assert told["track_m"] is None


def test_numbers_that_are_not_there_are_null_and_empty():
    runs = history(2)
    nothing = {**estimate(0.0, 0.0, "unobserved"), "value": None, "sigma": None}
    runs = [with_parameter(runs[0], "track_m", nothing), retold(runs[1], outage={"window_s": 30.0, "rms_m": None})]
    made = summarise(runs)
    document = json.loads(json.dumps(document_of(made), allow_nan=False))
    assert document["runs"][0]["parameters"]["track_m"]["value"] is None
    assert document["runs"][1]["outage"]["rms_m"] is None
    table = pd.read_csv(io.StringIO(summary_csv(made)))
    assert np.isnan(table.track_m[0])
    assert np.isnan(table.outage_rms_m[1])
    assert_index(index_html(made))


def test_the_table_is_a_table_of_numbers(summary):
    text = summary_csv(summary)
    assert text.endswith("\r\n")
    assert "\n" not in text.replace("\r\n", "")
    table = pd.read_csv(io.StringIO(text))
    assert table.columns[0] == "run"
    assert table.columns[-1] == "reason"
    assert table.track_m.dtype == table.heading_offset_deg_sigma.dtype == np.float64
    assert table.track_m[0] == summary.runs[0].parameters["track_m"].value
    assert table.verdict.value_counts().to_dict() == {"good": 11, "failed": 2, "partial": 1}
    assert table.reason.tolist()[-2:] == ["a bug", "broken/encoder.csv: is empty"]
    assert table.exit_code.tolist()[-2:] == [4, 3]
    assert table.run.tolist()[-2:] == ["'=cmd()", "broken"]


@given(st.text(max_size=12), st.text(max_size=12), st.text(max_size=12))
def test_no_text_from_outside_becomes_a_formula(run, vehicle, reason):
    runs = history(1, vehicle=vehicle)
    named = [replace(runs[0], run=run, verdict=Verdict("doubtful", (reason,)))]
    text = summary_csv(summarise(named, {}, [Failure(run, DataError(reason))]))
    rows = list(csv.reader(io.StringIO(text, newline="")))
    assert len(rows) == 3
    assert len({len(row) for row in rows}) == 1
    for cell in (cell for row in rows for cell in row):
        if cell.startswith(FORMULA_MARKS):
            float(cell)
    assert rows[1][0] in (run, f"'{run}")
    text.encode("utf-8")


def test_a_negative_number_stays_a_number():
    runs = history(1, change={"heading_offset_deg": np.array([-30.0])})
    assert float(pd.read_csv(io.StringIO(summary_csv(summarise(runs, [], [])))).heading_offset_deg[0]) < 0.0


def sentence_of(key, change, **more):
    made = summarise(history(len(change), change={key: change}, **more), [], [])
    return next(iter(changes(made)), "")


def test_a_step_is_told_with_its_dates_and_sign():
    text = sentence_of("track_m", 0.02 * (np.arange(13) >= 6), days=12.0)
    assert re.fullmatch(
        r"The track of tracked-demo changed between 2026-05-08 and 2026-05-09 by \+(19|20)\.?\d* ± 0\.\d+ mm "
        r"\(\d+ sigma, 13 runs\)\.",
        text,
    )


def test_an_onset_is_told_with_its_date():
    text = sentence_of("heading_offset_deg", -np.maximum(0.0, np.arange(25) - 12.0) * 0.35)
    assert re.match(
        r"The heading offset of tracked-demo was steady until 2026-0[56]-\d\d, and has been falling since: "
        r"-[34]\.\d+ ± 0\.\d+ deg in (2|3)\d days",
        text,
    )


def test_without_dates_the_sentence_names_runs():
    text = sentence_of("radius_right_m", np.linspace(0.0, 5e-4, 12), with_dates=False)
    assert "has been growing since run000: +0." in text
    assert "until run011" in text
    assert "for want of dates" in text


def test_drives_of_one_day_are_told_by_the_minute():
    text = sentence_of("track_m", 0.02 * (np.arange(12) >= 6), days=0.3)
    assert "between 2026-05-03 12:46 and 2026-05-03 13:25" in text


def test_a_steady_fleet_is_called_steady_and_few_runs_too_few():
    assert headline(summarise(history(15), [], [])).level == "steady"
    assert headline(summarise(history(3), [], [])).level == "too few runs"
    assert headline(summarise([], [], FAILURES)).because == ("2 runs gave no result; the reasons stand below.",)


def test_a_chart_is_drawn_for_every_kind_of_past():
    for runs in (worn(), worn(with_dates=False), history(6, days=0.01), history(4), history(20, days=4000.0)):
        made = summarise(runs, [], [])
        for chart in made.vehicles[0].charts:
            assert control_chart("v", chart).startswith("<svg")


def test_a_path_is_drawn_north_up_and_east_right():
    there = ThinPath(np.array([0.0, 10.0, 10.0]), np.array([0.0, 0.0, 5.0]))
    match = re.fullmatch(r"M(\d+) (\d+)l(-?\d+) (-?\d+)l(-?\d+) (-?\d+)", path_strokes(there))
    east, down, right, none, straight, up = map(int, match.groups())
    assert 0 < east < PATH_UNITS / 2 < down < PATH_UNITS
    assert right == pytest.approx(880, abs=1)
    assert (none, straight) == (0, 0)
    assert up == pytest.approx(-440, abs=1)
    assert path_strokes(ThinPath(np.ones(5), np.ones(5))) == ""
    assert path_strokes(ThinPath(np.empty(0), np.empty(0))) == ""


def test_the_sentence_s_own_numbers_are_those_of_the_chart(summary):
    chart = next(chart for chart in summary.vehicles[0].charts if chart.key == "radius_left_m")
    text = change_sentence("x", chart)
    value, sigma = re.search(r"(-\d+\.\d+) ± (\d+\.\d+) mm", text).groups()
    assert float(value) == pytest.approx(1000 * chart.trend.change, abs=0.001)
    assert float(sigma) == pytest.approx(1000 * chart.trend.sigma, abs=0.001)
