"""The command line on good and on broken logs: results or one clear line, an exit code, and never a traceback."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import math
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import yaml

from sccal.batch.record import RECORD_FILE
from sccal.cli import main

pytestmark = pytest.mark.filterwarnings("error")

LIGHT = ("encoder.rate_hz=20", "ahrs.rate_hz=10", "gnss.rate_hz=5")
RESULTS = ("calibration.json", "trajectory.csv", "trajectory.tum", "report.html", "ros2_control.yaml")
PARAMETERS = ("radius_right_m", "radius_left_m", "track_m", "heading_offset_deg")


@dataclass(frozen=True)
class Outcome:
    """What one call left: exit code and both streams."""

    code: int
    out: str
    err: str

    @property
    def failures(self) -> list[str]:
        """The lines on stderr, which are all the command's own."""
        lines = self.err.splitlines()
        assert all(line.startswith("sccal: ") for line in lines), self.err
        return lines


def sccal(*arguments: object) -> Outcome:
    """Call the command line in this process, as its entry point does."""
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        patch.setattr(sys, "argv", ["sccal", *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            main()
    code = caught.value.code
    return Outcome(0 if code is None else int(code), out.getvalue(), err.getvalue())


def simulated(folder: Path, *settings: str, path: str = "general", duration_s: float = 70.0) -> Path:
    chosen = [argument for setting in (*LIGHT, *settings) for argument in ("--set", setting)]
    made = sccal("simulate", folder, "--path", path, "--duration", duration_s, "--seed", 4, *chosen)
    assert (made.code, made.err) == (0, "")
    return folder


def strict_json(path: Path) -> dict[str, Any]:
    def refuse(constant: str) -> None:
        raise ValueError(f"{path.name} holds {constant}")

    document = json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)
    assert isinstance(document, dict)
    return document


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return simulated(tmp_path_factory.mktemp("logs") / "good")


@pytest.fixture(scope="module")
def results(good: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of the good run; the filter is compiled from here on."""
    out = tmp_path_factory.mktemp("results")
    found = sccal("calibrate", good, "--out", out)
    assert found.code == 0
    return out / "good"


@pytest.fixture
def broken(good: Path, results: Path, tmp_path: Path) -> Path:
    """A copy of the good run, to be broken."""
    return Path(shutil.copytree(good, tmp_path / "logs" / "run"))


def calibrate(folder: Path, *options: object) -> tuple[Outcome, Path]:
    out = folder.parent.parent / "out"
    return sccal("calibrate", folder, "--out", out, *options), out / folder.name


def refused(folder: Path, *names: str) -> str:
    """The one line of a run that gives no result; it names the file."""
    outcome, out = calibrate(folder)
    assert outcome.code == 3, outcome
    [line] = outcome.failures
    assert all(name in line for name in names), line
    assert not out.exists()
    return line


def accepted(folder: Path, *options: object) -> dict[str, Any]:
    """The calibration of a run that gives a result; it is near the truth, and nothing is on stderr."""
    outcome, out = calibrate(folder, *options)
    assert (outcome.code, outcome.err) == (0, "")
    found = strict_json(out / "calibration.json")
    require_truth(found, folder)
    return found


def require_truth(found: dict[str, Any], folder: Path) -> None:
    truth = json.loads((folder / "truth.json").read_text())["parameters"]
    for name in PARAMETERS:
        estimate = found["parameters"][name]
        if estimate["status"] == "estimated":
            tolerance = 1.5 if name == "heading_offset_deg" else 4.0 * estimate["sigma"]
            assert abs(estimate["value"] - truth[name]) < tolerance, name


def counted(found: dict[str, Any], source: str, words: str) -> int:
    """How many things the notices of one file about these words counted."""
    return sum(n["count"] for n in found["notices"] if n["source"] == source and words in n["what"])


def rows_of(path: Path) -> list[list[str]]:
    return list(csv.reader(path.read_text().splitlines()))


def write_rows(path: Path, rows: list[list[str]]) -> None:
    path.write_text("".join(",".join(row) + "\n" for row in rows))


def backwards(stamps: list[str], begin_s: float, length_s: float = 5.0) -> list[str]:
    """The stamps with those of a stretch in reverse order."""
    zero = float(stamps[0])
    stretch = [i for i, t in enumerate(stamps) if begin_s <= float(t) - zero < begin_s + length_s]
    turned = list(stamps)
    turned[stretch[0] : stretch[-1] + 1] = [stamps[i] for i in reversed(stretch)]
    return turned


# Whole runs


def test_every_result_is_there_and_can_be_read(results: Path) -> None:
    assert sorted(path.name for path in results.iterdir()) == sorted([RECORD_FILE, *RESULTS])
    found = strict_json(results / "calibration.json")
    assert found["schema"] == "sccal.calibration/1"
    assert tuple(found["parameters"]) == PARAMETERS
    assert {estimate["status"] for estimate in found["parameters"].values()} == {"estimated"}
    assert strict_json(results.parent / "vehicle.json")["parameters"].keys() == found["parameters"].keys()

    rows = rows_of(results / "trajectory.csv")
    assert ",".join(rows[0]) == "t,east_m,north_m,yaw_rad,sigma_east_m,sigma_north_m,sigma_yaw_rad"
    numbers = [[float(cell) for cell in row] for row in rows[1:]]
    assert all(math.isfinite(cell) for row in numbers for cell in row)
    assert 690 < len(numbers) <= 701
    assert all(0.09 < after[0] - before[0] < 0.11 for before, after in pairwise(numbers))

    poses = [[float(cell) for cell in line.split()] for line in (results / "trajectory.tum").read_text().splitlines()]
    assert len(poses) == len(numbers)
    assert all(sum(q * q for q in pose[4:]) == pytest.approx(1.0, abs=1e-5) for pose in poses)

    parameters = yaml.safe_load((results / "ros2_control.yaml").read_text())
    assert isinstance(parameters, dict)
    page = (results / "report.html").read_text(encoding="utf-8")
    assert page.lstrip().lower().startswith("<!doctype html>")
    assert 'src="http' not in page
    assert 'href="http' not in page


def test_the_truth_is_found(good: Path, results: Path) -> None:
    found = strict_json(results / "calibration.json")
    require_truth(found, good)
    assert found["parameters"]["radius_right_m"]["sigma"] < 0.002 * 0.08
    assert found["parameters"]["track_m"]["sigma"] < 0.01 * 0.70
    assert found["parameters"]["heading_offset_deg"]["sigma"] < 0.7


def test_the_same_call_gives_the_same_bytes(good: Path, results: Path, tmp_path: Path) -> None:
    assert sccal("calibrate", good, "--out", tmp_path).code == 0
    for name in ("calibration.json", "trajectory.csv", "ros2_control.yaml"):
        assert (tmp_path / "good" / name).read_bytes() == (results / name).read_bytes(), name


def test_a_straight_drive_cannot_show_the_track(results: Path, tmp_path: Path) -> None:
    parameters = accepted(simulated(tmp_path / "logs" / "run", path="straight"))["parameters"]
    assert parameters["track_m"]["status"] == "unobserved"
    assert parameters["track_m"]["reason"]
    assert parameters["heading_offset_deg"]["status"] == "estimated"


def test_without_the_offset_state_the_offset_is_held(results: Path, tmp_path: Path) -> None:
    run = simulated(tmp_path / "logs" / "run", "ahrs.heading_offset_deg=0")
    parameters = accepted(run, "--no-offset")["parameters"]
    assert parameters["heading_offset_deg"]["status"] == "held"
    assert parameters["heading_offset_deg"]["value"] == 0.0
    assert parameters["track_m"]["status"] == "estimated"


def test_a_compass_and_a_clock_from_zero(results: Path, tmp_path: Path) -> None:
    settings = ("ahrs.convention=ned", "ahrs.heading_offset_deg=-170", "clock.host_epoch_offset_s=1717243103")
    found = accepted(simulated(tmp_path / "logs" / "run", *settings))
    assert found["parameters"]["heading_offset_deg"]["value"] == pytest.approx(-170.0, abs=3.0)
    assert found["clock"]["offset_s"] == pytest.approx(-1717243103 + 0.02, abs=0.01)


def test_a_run_beyond_the_year_2038(results: Path, tmp_path: Path) -> None:
    found = accepted(simulated(tmp_path / "logs" / "run", "clock.start_utc_s=2147483610"))
    assert counted(found, "gnss.nmea", "date") == 0


def test_a_run_too_short_for_an_outage_says_null(results: Path, tmp_path: Path) -> None:
    outage = accepted(simulated(tmp_path / "logs" / "run", duration_s=30.0))["outage"]
    assert outage["windows"] == 0
    assert outage["rms_m"] is outage["end_rms_m"] is outage["percent_of_distance"] is None


# The command itself


def test_help_lists_the_commands() -> None:
    found = sccal("--help")
    assert (found.code, found.err) == (0, "")
    assert "calibrate" in found.out
    assert "simulate" in found.out


@pytest.mark.parametrize("command", ["calibrate", "simulate"])
def test_help_of_each_command(command: str) -> None:
    found = sccal(command, "--help")
    assert (found.code, found.err) == (0, "")
    assert "Usage" in found.out


@pytest.mark.parametrize("arguments", [("calibrat",), ("calibrate",), ("calibrate", ".", "--window", "0"), ("--what",)])
def test_wrong_usage(arguments: tuple[str, ...]) -> None:
    found = sccal(*arguments)
    assert found.code == 2
    assert "Traceback" not in found.err


def test_a_path_that_does_not_exist(tmp_path: Path) -> None:
    found = sccal("calibrate", tmp_path / "nowhere", "--out", tmp_path / "out")
    assert found.code == 2
    [line] = found.failures
    assert str(tmp_path / "nowhere") in line


@pytest.mark.parametrize("command", ["calibrate", "simulate"])
def test_results_do_not_overwrite_a_file(good: Path, tmp_path: Path, command: str) -> None:
    (tmp_path / "file").write_text("mine")
    arguments = ("calibrate", good, "--out") if command == "calibrate" else ("simulate",)
    found = sccal(*arguments, tmp_path / "file")
    assert found.code == 2
    assert len(found.failures) == 1
    assert (tmp_path / "file").read_text() == "mine"


def test_an_empty_folder(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    found = sccal("calibrate", tmp_path / "empty", "--out", tmp_path / "out")
    assert found.code == 3
    [line] = found.failures
    assert str(tmp_path / "empty") in line
    assert not (tmp_path / "out").exists()


# Runs that give no result


@pytest.mark.parametrize("name", ["encoder.csv", "ahrs.csv", "gnss.nmea", "vehicle.toml"])
def test_a_file_that_is_missing(broken: Path, name: str) -> None:
    (broken / name).unlink()
    refused(broken, name)


@pytest.mark.parametrize("name", ["encoder.csv", "ahrs.csv", "gnss.nmea", "vehicle.toml"])
def test_a_file_of_no_bytes(broken: Path, name: str) -> None:
    (broken / name).write_bytes(b"")
    refused(broken, name)


def test_a_gnss_csv_of_no_bytes(broken: Path) -> None:
    (broken / "gnss.nmea").unlink()
    (broken / "gnss.csv").write_bytes(b"")
    refused(broken, "gnss.csv")


@pytest.mark.parametrize("name", ["encoder.csv", "ahrs.csv", "gnss.nmea", "vehicle.toml"])
def test_a_file_of_garbage(broken: Path, name: str) -> None:
    (broken / name).write_bytes(bytes(range(256)) * 40)
    refused(broken, name)


@pytest.mark.parametrize("rows", [0, 1])
@pytest.mark.parametrize("name", ["encoder.csv", "ahrs.csv"])
def test_a_table_with_hardly_more_than_its_header(broken: Path, name: str, rows: int) -> None:
    write_rows(broken / name, rows_of(broken / name)[: 1 + rows])
    assert "usable row" in refused(broken, name)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("wheel_radius_m =", "TOML"),
        ("[nominal]\ntrack_m = 0.7\n[encoder]\nticks_per_rev = 32768\n", "wheel_radius_m"),
        ("[nominal]\nwheel_radius_m = -0.08\ntrack_m = 0.7\n[encoder]\nticks_per_rev = 32768\n", "positive"),
        ("[nominal]\nwheel_radius_m = nan\ntrack_m = 0.7\n[encoder]\nticks_per_rev = 32768\n", "finite"),
        ("[nominal]\nwheel_radius_m = 0.08\ntrack_m = 'wide'\n[encoder]\nticks_per_rev = 32768\n", "track_m"),
        ("[nominal]\nwheel_radius_m = 0.08\ntrack_m = 0.7\n", "ticks_per_rev"),
        (
            "[nominal]\nwheel_radius_m = 0.08\ntrack_m = 0.7\n[encoder]\nticks_per_rev = 9\n[ahrs]\nconvention = 'nwu'",
            "convention",
        ),
    ],
)
def test_a_vehicle_that_makes_no_sense(broken: Path, text: str, word: str) -> None:
    (broken / "vehicle.toml").write_text(text)
    assert word in refused(broken, "vehicle.toml")


def test_streams_that_never_meet(broken: Path) -> None:
    rows = rows_of(broken / "ahrs.csv")
    write_rows(broken / "ahrs.csv", [rows[0]] + [[f"{float(row[0]) - 5000:.4f}", *row[1:]] for row in rows[1:]])
    assert "do not overlap" in refused(broken, "ahrs.csv")


def test_a_wrong_convention(broken: Path) -> None:
    text = (broken / "vehicle.toml").read_text()
    (broken / "vehicle.toml").write_text(text.replace('"enu"', '"ned"'))
    assert 'convention = "enu"' in refused(broken, "vehicle.toml")


def test_a_wheel_that_counts_backwards(broken: Path) -> None:
    rows = rows_of(broken / "encoder.csv")
    write_rows(broken / "encoder.csv", [rows[0]] + [[t, str(-int(left)), right] for t, left, right in rows[1:]])
    assert "left_ticks" in refused(broken, "encoder.csv")


def test_a_robot_that_stands(results: Path, tmp_path: Path) -> None:
    run = simulated(tmp_path / "logs" / "run", "drive.stand_first_s=60", path="straight", duration_s=60.0)
    assert "hardly moves" in refused(run, "run")


# Runs with faults that are repaired and counted


@pytest.mark.parametrize(("name", "column"), [("encoder.csv", 1), ("ahrs.csv", 1), ("encoder.csv", 0)])
def test_a_cell_of_text(broken: Path, name: str, column: int) -> None:
    rows = rows_of(broken / name)
    rows[200][column] = "fault"
    write_rows(broken / name, rows)
    found = accepted(broken)
    [notice] = [n for n in found["notices"] if n["source"] == name and "unreadable" in n["what"]]
    assert (notice["count"], notice["where"]) == (1, "line 201")


def test_an_nmea_file_cut_in_the_middle(broken: Path) -> None:
    data = (broken / "gnss.nmea").read_bytes()
    cut = data.rindex(b"GGA", 0, int(0.7 * len(data))) + 30
    (broken / "gnss.nmea").write_bytes(data[:cut])
    assert counted(accepted(broken), "gnss.nmea", "cut in the middle") == 1


def test_a_table_cut_in_the_middle(broken: Path) -> None:
    data = (broken / "encoder.csv").read_bytes()
    (broken / "encoder.csv").write_bytes(data[: data.rindex(b",", 0, int(0.8 * len(data))) + 2])
    assert counted(accepted(broken), "encoder.csv", "cut in the middle") == 1


def test_wrong_checksums(broken: Path) -> None:
    lines = (broken / "gnss.nmea").read_text().splitlines()
    wrong = [i for i in range(len(lines)) if i % 10 in (2, 5, 7)]
    for i in wrong:
        lines[i] = lines[i][:-2] + f"{int(lines[i][-2:], 16) ^ 0x5A:02X}"
    (broken / "gnss.nmea").write_text("\n".join(lines) + "\n")
    found = accepted(broken)
    [notice] = [n for n in found["notices"] if "wrong checksum" in n["what"]]
    assert (notice["count"], notice["severity"]) == (len(wrong), "warning")


@pytest.mark.parametrize("name", ["encoder.csv", "ahrs.csv"])
def test_time_running_backwards_in_a_table(broken: Path, name: str) -> None:
    rows = rows_of(broken / name)
    stamps = backwards([row[0] for row in rows[1:]], 30.0)
    write_rows(broken / name, [rows[0]] + [[t, *row[1:]] for t, row in zip(stamps, rows[1:], strict=True)])
    found = accepted(broken)
    assert counted(found, name, "dropped") > 0
    assert any(n["severity"] == "warning" for n in found["notices"] if n["source"] == name)


def test_time_running_backwards_in_the_receive_times(broken: Path) -> None:
    lines = [line.split(" ", 1) for line in (broken / "gnss.nmea").read_text().splitlines()]
    stamps = backwards([line[0] for line in lines], 30.0)
    text = "".join(f"{t} {sentence}\n" for t, (_, sentence) in zip(stamps, lines, strict=True))
    (broken / "gnss.nmea").write_text(text)
    accepted(broken)


def shifted_from_the_middle(path: Path, shift_s: float) -> None:
    rows = rows_of(path)
    half = len(rows) // 2
    write_rows(path, rows[:half] + [[f"{float(t) + shift_s:.4f}", *rest] for t, *rest in rows[half:]])


@pytest.mark.parametrize("name", ["encoder.csv", "ahrs.csv"])
def test_a_clock_that_stays_behind_is_never_passed_over(broken: Path, name: str) -> None:
    shifted_from_the_middle(broken / name, -5.0)
    outcome, out = calibrate(broken)
    assert outcome.code in (0, 3)
    if outcome.code == 3:
        [line] = outcome.failures
        assert name in line
    else:
        warnings = [n for n in strict_json(out / "calibration.json")["notices"] if n["severity"] == "warning"]
        assert any(n["source"] == name and "clock stepped back" in n["what"] for n in warnings)


def test_a_heading_clock_that_stays_behind_is_not_called_good(broken: Path) -> None:
    shifted_from_the_middle(broken / "ahrs.csv", -5.0)
    outcome, out = calibrate(broken)
    assert outcome.code == 3 or not strict_json(out / "calibration.json")["verdict"].startswith("good")


def test_a_receiver_that_froze(broken: Path) -> None:
    (broken / "gnss.nmea").unlink()
    fixes = "".join(f"{1717243200 + 0.2 * i:.3f},37.5256,15.0744\n" for i in range(350))
    (broken / "gnss.csv").write_text("t,lat_deg,lon_deg\n" + fixes)
    assert "repeat another's position" in refused(broken)


def test_lines_of_nmea_in_reverse_order(broken: Path) -> None:
    lines = (broken / "gnss.nmea").read_text().splitlines()
    middle = len(lines) // 2
    lines[middle : middle + 30] = reversed(lines[middle : middle + 30])
    (broken / "gnss.nmea").write_text("\n".join(lines) + "\n")
    assert counted(accepted(broken), "gnss.nmea", "") > 0


@pytest.mark.parametrize("name", ["encoder.csv", "ahrs.csv"])
@pytest.mark.parametrize("row", [1, 300, -1])
def test_one_stamp_of_the_year_2038(broken: Path, name: str, row: int) -> None:
    rows = rows_of(broken / name)
    rows[row][0] = "2147483647.0000"
    write_rows(broken / name, rows)
    assert counted(accepted(broken), name, "dropped") >= 1


def test_one_date_of_the_year_2038(broken: Path) -> None:
    lines = (broken / "gnss.nmea").read_text().splitlines()
    row = next(i for i, line in enumerate(lines) if "RMC" in line and i > len(lines) // 2)
    stamp, sentence = lines[row].split(" ")
    body = sentence[1:-3].replace(",010624,", ",190138,")
    check = 0
    for byte in body.encode():
        check ^= byte
    lines[row] = f"{stamp} ${body}*{check:02X}"
    (broken / "gnss.nmea").write_text("\n".join(lines) + "\n")
    assert counted(accepted(broken), "gnss.nmea", "dates that the others contradict") == 1


# Several runs


@dataclass(frozen=True)
class Fault:
    """What breaks a run, and what its one line names."""

    name: str
    act: Callable[[Path], object]


FAULTS = {
    "no_wheels": Fault("encoder.csv", lambda run: (run / "encoder.csv").unlink()),
    "empty_heading": Fault("ahrs.csv", lambda run: (run / "ahrs.csv").write_bytes(b"")),
    "bad_vehicle": Fault("vehicle.toml", lambda run: (run / "vehicle.toml").write_text("[nominal")),
    "no_fixes": Fault("gnss.nmea", lambda run: (run / "gnss.nmea").write_text("nothing to see\n" * 50)),
}


def test_bad_runs_do_not_stop_the_good_ones(good: Path, results: Path, tmp_path: Path) -> None:
    logs, out = tmp_path / "logs", tmp_path / "out"
    for name in ("a_good", *FAULTS, "z_good"):
        shutil.copytree(good, logs / name)
    for name, fault in FAULTS.items():
        fault.act(logs / name)
    (tmp_path / "empty").mkdir()
    found = sccal("calibrate", logs, tmp_path / "empty", "--out", out)
    assert found.code == 3

    *failures, summary = found.failures
    assert summary == "sccal: 5 of 7 gave no result"
    assert len(failures) == 5
    for name, fault in FAULTS.items():
        [line] = [line for line in failures if line.startswith(f"sccal: {name}: ")]
        assert fault.name in line
    assert len([line for line in failures if str(tmp_path / "empty") in line]) == 1

    assert sorted(path.name for path in out.iterdir() if path.is_dir()) == ["a_good", "z_good"]
    for name in ("a_good", "z_good"):
        assert sorted(path.name for path in (out / name).iterdir()) == sorted([RECORD_FILE, *RESULTS])
        assert strict_json(out / name / "calibration.json")["run"] == name
    alone, together = (strict_json(path / "calibration.json") for path in (results, out / "a_good"))
    assert together["parameters"] == alone["parameters"]
    assert [run["run"] for run in strict_json(out / "vehicle.json")["runs"]] == ["a_good", "z_good"]


def test_results_are_not_taken_for_logs(good: Path, results: Path, tmp_path: Path) -> None:
    logs = tmp_path / "logs"
    shutil.copytree(good, logs / "run")
    for _ in range(2):
        assert sccal("calibrate", logs, "--out", logs / "out").code == 0
    assert [run.name for run in (logs / "out").iterdir() if run.is_dir()] == ["run"]


def test_results_never_land_among_the_logs(good: Path) -> None:
    found = sccal("calibrate", good, "--out", good.parent)
    assert found.code == 2
    assert len(found.failures) == 1
    assert not (good / "calibration.json").exists()
