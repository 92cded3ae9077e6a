"""The command, and the commands that its page shows."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

import sccal
from sccal.cli import main
from sccal.cli.app import app
from sccal.export.catalogue import FORMATS
from sccal.export.result import read_result
from sccal.results.converter import document_of, json_text

PAGE = Path(sccal.__file__).parents[1] / "docs" / "export.md"
EXAMPLES = [
    line.strip() for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("    sccal export")
]


def run(*arguments):
    return CliRunner().invoke(app, ["export", *map(str, arguments)])


def ends(monkeypatch, *arguments):
    """The exit code, as the shell sees it."""
    monkeypatch.setattr("sys.argv", ["sccal", "export", *map(str, arguments)])
    with pytest.raises(SystemExit) as caught:
        main()
    return caught.value.code


@pytest.fixture
def out(enu_robot, tmp_path, monkeypatch):
    """A folder of results with a run and a vehicle, to work in from beside it."""
    folder = tmp_path / "out"
    (folder / "monday").mkdir(parents=True)
    for file in enu_robot.results.iterdir():
        (folder / "monday" / file.name).write_bytes(file.read_bytes())
    run = document_of(enu_robot.exported.run)
    in_short = [{key: run[key] for key in ("run", "verdict", "parameters")}] * 2
    document = run | {"run": "(vehicle)", "runs": in_short}
    (folder / "vehicle.json").write_text(json_text(document))
    monkeypatch.chdir(tmp_path)
    return folder


@pytest.mark.parametrize("arguments", [(), ("--list",)])
def test_formats_are_listed_a_line_each(arguments):
    lines = run(*arguments).stdout.splitlines()
    assert [line.split()[0] for line in lines] == list(FORMATS)
    assert all(len(line) < 100 for line in lines)


@pytest.mark.parametrize("name", FORMATS)
def test_output_and_file_are_the_same(name, out):
    printed = run(name, "out/monday")
    assert printed.exit_code == 0
    assert printed.stdout == FORMATS[name].write(read_result(out / "monday"))
    written = run(name, "out/monday/calibration.json", "-o", "file")
    assert (written.exit_code, written.stdout) == (0, "")
    assert Path("file").read_text(encoding="utf-8") == printed.stdout
    assert [path.name for path in Path().iterdir() if path.name.startswith(".")] == []


def test_a_vehicles_parameters_and_no_path(out, monkeypatch, capsys):
    assert "2 runs together" in run("ros2_control", "out").stdout
    assert ends(monkeypatch, "gpx", "out") == 2
    assert "no path; name the folder of one run" in capsys.readouterr().err


def test_what_is_left_out_goes_to_the_error_stream(out):
    told = run("ros2_control", "out/monday")
    assert "sccal: ros2_control: lever_arm was estimated too" in told.stderr
    assert "sccal:" not in told.stdout


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (("shapefile", "out/monday"), 2, "no format 'shapefile'; there are ros2_control,"),
        (("gpx",), 2, "name the results"),
        (("gpx", "nowhere"), 2, "no such file"),
        (("gpx", "out/monday", "-o", "missing/path.gpx"), 3, "missing/path.gpx: cannot be written"),
    ],
)
def test_what_cannot_be_done_is_said(out, monkeypatch, capsys, arguments, code, says):
    assert ends(monkeypatch, *arguments) == code
    assert says in capsys.readouterr().err


def test_a_run_without_its_path_is_said(out, monkeypatch, capsys):
    (out / "monday" / "trajectory.csv").unlink()
    assert ends(monkeypatch, "kml", "out/monday") == 3
    assert "trajectory.csv" in capsys.readouterr().err
    assert run("ardupilot", "out/monday").exit_code == 0


@pytest.mark.parametrize("example", EXAMPLES)
def test_every_command_of_the_page_works(out, example):
    done = CliRunner().invoke(app, shlex.split(example)[1:])
    assert done.exit_code == 0, done.output
    target = re.search(r"-o (\S+)", example)
    assert (Path(target[1]).read_text() if target else done.stdout).strip()


def test_the_page_has_every_format_and_no_other():
    page = PAGE.read_text(encoding="utf-8")
    assert re.findall(r"^\| `(\w+)`", page, re.MULTILINE) == list(FORMATS)
    assert {line.split()[2] for line in EXAMPLES if len(line.split()) > 2} == set(FORMATS)
