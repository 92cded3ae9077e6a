"""sccal inspect: exit codes, what stands on which stream, and the files it leaves."""

from __future__ import annotations

import contextlib
import io
import json
import re
import shutil
import sys
from pathlib import Path

import pytest

from sccal.cli import main
from sccal.report.inspection.page import inspection_html
from sccal.report.inspection.text import inspection_text
from tests.inspect.logs import inspected

pytestmark = pytest.mark.filterwarnings("error")


def sccal(*arguments: object) -> tuple[int, str, str]:
    """Exit code and both streams."""
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        patch.setattr(sys, "argv", ["sccal", "inspect", *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            main()
    return int(caught.value.code or 0), out.getvalue(), err.getvalue()


def strict(text: str) -> dict:
    def refuse(constant):
        raise ValueError(constant)

    return json.loads(text, parse_constant=refuse)


@pytest.fixture(scope="module")
def logs(general_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A good run, one without heading, and one that nothing can be read of."""
    folder = tmp_path_factory.mktemp("logs")
    for name in ("good", "half", "nothing"):
        shutil.copytree(general_run, folder / name)
    (folder / "half" / "ahrs.csv").unlink()
    for name in ("encoder.csv", "ahrs.csv", "gnss.nmea"):
        (folder / "nothing" / name).write_bytes(b"")
    return folder


def test_anything_that_can_be_inspected_is(logs):
    before = sorted(logs.rglob("*"))
    code, out, err = sccal(logs)
    assert code == 0
    assert "good: all streams" in out
    assert "lacks ahrs.csv" in " ".join(out.split())
    assert err.count("\n") == 1
    assert err.startswith("sccal: nothing: ")
    assert sorted(logs.rglob("*")) == before


def test_nothing_at_all_is_a_data_error(logs, tmp_path):
    code, out, err = sccal(logs / "nothing")
    assert (code, out.strip()) == (3, "")
    assert "is empty" in err
    (tmp_path / "empty").mkdir()
    assert sccal(tmp_path / "empty")[0] == 3
    assert sccal(tmp_path / "nowhere")[0] == 2


def test_json_and_nothing_else(logs):
    code, out, _ = sccal(logs, "--json")
    document = strict(out)
    assert (code, document["schema"]) == (0, "sccal.inspect/1")
    good, half = document["runs"]
    assert (good["run"], good["calibratable"]) == ("good", True)
    assert set(good["streams"]) == {"wheels", "heading", "fixes"}
    assert good["drive"]["turned_left_deg"] > 90.0
    assert {one["shown"] for one in good["excited"]["effects"]} <= {"yes", "weak", "no"}
    assert good["yaw_minus_course"]["offset_deg"] == pytest.approx(12.5, abs=1.0)
    assert half["calibratable"] is False
    assert set(half["streams"]) == {"wheels", "fixes"}
    assert [one["name"] for one in document["failures"]] == ["nothing"]


def test_json_when_there_is_nothing(logs):
    code, out, _ = sccal(logs / "nothing", "--json")
    assert code == 3
    assert strict(out)["runs"] == []


def test_pages(logs, tmp_path):
    out = tmp_path / "out"
    code, text, _ = sccal(logs, "--out", out)
    assert code == 0
    assert sorted(path.relative_to(out).as_posix() for path in out.rglob("*.*")) == [
        f"{name}/inspect.{kind}" for name in ("good", "half") for kind in ("html", "json")
    ]
    assert text.count("report: ") == 2
    [one] = strict((out / "half" / "inspect.json").read_text())["runs"]
    assert one == strict(sccal(logs / "half", "--json")[1])["runs"][0] | {"path": one["path"]}
    page = (out / "good" / "inspect.html").read_text()
    assert page.count("<svg") == 2
    assert not re.search(r"(?:src|href)=\"(?:https?:)?//", page)
    assert len(page) < 500_000


def test_never_among_the_logs(logs):
    code, _, err = sccal(logs, "--out", logs)
    assert code == 2
    assert "own folder" in err
    assert not list(logs.rglob("inspect.*"))


@pytest.mark.parametrize("width", [60, 80, 120])
@pytest.mark.parametrize("run", ["good", "half"])
def test_lines_fit_the_terminal(logs, run, width):
    lines = inspection_text(inspected(logs / run), width).splitlines()
    long = [line for line in lines if len(line) > width and " " in line.strip() and "|" not in line]
    assert not [line for line in long if not line.startswith(("stream", "wheels", "heading", "fixes"))]
    assert max(map(len, lines)) <= max(width, 80)


def test_names_cannot_break_the_page(logs, tmp_path):
    run = Path(shutil.copytree(logs / "good", tmp_path / "<b>run"))
    page = inspection_html(inspected(run))
    assert "<b>run" not in page
    assert "&lt;b&gt;run" in page


def test_the_same_call_gives_the_same_bytes(logs, tmp_path):
    for k in "ab":
        sccal(logs / "good", "--out", tmp_path / k)
    for name in ("inspect.html", "inspect.json"):
        one, other = ((tmp_path / k / "good" / name).read_bytes() for k in "ab")
        assert one == other
