"""Every command in the README and in docs/ is executed, page by page, in the order in which a reader types them."""

from __future__ import annotations

import contextlib
import io
import json
import math
import re
import shlex
import shutil
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from sccal.cli import main
from sccal.logs.run import discover, read_run
from sccal.logs.streams import Run
from tests.compare.test_diagnoses import document, finding
from tests.message_logs import json_bytes, messages_of, stamp, write_mcap, write_ros1
from tests.results.documents import held_to_its_schema, schema_file
from tests.runs import written

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
COMMAND = re.compile(r"^ {4}(?:\.venv/bin/)?(?P<line>(?:sccal|make|python docs/\S+) .*?|make)(?:\s{2,}#.*)?$")
SHORTER = {
    "experiments": ["--seeds", "1", "--duration", "120"],
    "simulate": ["--set", "encoder.rate_hz=20", "--set", "ahrs.rate_hz=10"],
}
"""Options that make a command short enough for a test; the rest of it is as it stands."""
ELSEWHERE = {"make": "a target of the Makefile", "python": "a picture or a page, drawn again by hand"}
Row = tuple[str, str, int, Mapping[str, Any]]
CHANGED = {"--duration 600": "--duration 120", "--duration 320": "--duration 120"}


def commands_of(page: Path) -> list[str]:
    """The commands of a page's indented blocks, in order."""
    lines = page.read_text(encoding="utf-8").splitlines()
    return [found["line"].strip() for line in lines if (found := COMMAND.match(line))]


@pytest.fixture(scope="session")
def materials(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the pages' commands find: logs under the names that the pages use."""
    folder = tmp_path_factory.mktemp("docs")
    logs = folder / "path" / "to" / "logs"
    for seed, name in enumerate(("monday", "tuesday")):
        written(logs / name, path="calibration", duration_s=120.0, seed=seed)
    (logs / "tuesday" / "vehicle.toml").unlink()
    (logs / "monday" / "vehicle.toml").rename(logs / "vehicle.toml")
    shutil.copytree(logs, folder / "logs")
    shutil.copy(logs / "vehicle.toml", folder)
    run = read_run(discover([logs])[0])
    nmea = (logs / "monday" / "gnss.nmea").read_bytes()
    write_mcap(run, folder / "drive.mcap", nmea)
    write_ros1(messages_of(run, None), folder / "drive.bag")
    (folder / "base.mcap").write_bytes(json_bytes(_other_topics(run)))
    (folder / "own.mcap").write_bytes(json_bytes(_own_types(run)))
    assert executed(["calibrate", str(logs), "--out", str(folder / "out"), "--jobs", "1"]) == 0
    shutil.copy(folder / "out" / "vehicle.json", folder / "previous.json")
    for name, *found in (("before",), ("after", finding("lever_arm", forward_m=(0.3, 0.01)))):
        (folder / name).mkdir()
        (folder / name / "diagnosis.json").write_text(json.dumps(document(*found)))
    return folder


def _fixes(run: Run) -> Iterator[Row]:
    fixes = run.fixes
    for t_s, lat_deg, lon_deg in zip(
        fixes.host_t_s.tolist(), fixes.lat_deg.tolist(), fixes.lon_deg.tolist(), strict=True
    ):
        status = {"status": 2, "service": 1}
        values = {"header": stamp(t_s), "status": status, "latitude": lat_deg, "longitude": lon_deg, "altitude": 0.0}
        yield "/fix", "sensor_msgs/msg/NavSatFix", round(t_s * 1e9), values


def _other_topics(run: Run) -> list[Row]:
    """Wheels under other names, and a second topic of wheels beside them."""
    rows = list(_fixes(run))
    wheels, heading = run.wheels, run.heading
    for t_s, left, right in zip(wheels.t_s.tolist(), wheels.left_rad.tolist(), wheels.right_rad.tolist(), strict=True):
        for topic, names in (("/base/joint_states", ["wheel_l", "wheel_r"]), ("/arm/joint_states", ["one", "two"])):
            values = {"header": stamp(t_s), "name": names, "position": [left, right]}
            rows.append((topic, "sensor_msgs/msg/JointState", round(t_s * 1e9), values))
    for t_s, yaw in zip(heading.t_s.tolist(), heading.yaw_rad.tolist(), strict=True):
        turned = {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}
        values = {"header": stamp(t_s), "orientation": turned}
        rows.append(("/imu/data", "sensor_msgs/msg/Imu", round(t_s * 1e9), values))
    return sorted(rows, key=lambda row: row[2])


def _own_types(run: Run) -> list[Row]:
    """Wheels and compass as messages of types that nobody else has."""
    rows = list(_fixes(run))
    wheels, heading = run.wheels, run.heading
    per_rad = 32768 / (2 * math.pi)
    for t_s, left, right in zip(wheels.t_s.tolist(), wheels.left_rad.tolist(), wheels.right_rad.tolist(), strict=True):
        values = {"left": round(left * per_rad), "right": round(right * per_rad)}
        rows.append(("/wheels", "robot/Wheels", round(t_s * 1e9), values))
    for t_s, yaw in zip(heading.t_s.tolist(), heading.yaw_rad.tolist(), strict=True):
        rows.append(("/compass", "robot/Compass", round(t_s * 1e9), {"heading_deg": math.degrees(yaw)}))
    return sorted(rows, key=lambda row: row[2])


def test_pages_have_commands():
    assert {page.name for page in PAGES if commands_of(page)} >= {"README.md", "first-hour.md", "messages.md"}
    assert "sccal calibrate path/to/logs" in commands_of(ROOT / "README.md")


LONG = pytest.mark.slow
RUN = [pytest.param(page, marks=LONG if page.stem == "first-hour" else ()) for page in PAGES if commands_of(page)]


@pytest.mark.parametrize("page", RUN, ids=lambda page: page.stem)
def test_every_command_of_a_page_works(page, materials, tmp_path, monkeypatch):
    shutil.copytree(materials, tmp_path, dirs_exist_ok=True)
    (tmp_path / "sample_logs").symlink_to(ROOT / "sample_logs")
    if page.stem == "first-hour":
        shutil.rmtree(tmp_path / "logs")
    monkeypatch.chdir(tmp_path)
    for line in commands_of(page):
        program, *arguments = shlex.split(line)
        if program in ELSEWHERE:
            if program == "make" and arguments:
                assert f"\n{arguments[0]}:" in (ROOT / "Makefile").read_text()
            continue
        for long, short in CHANGED.items():
            line = line.replace(long, short)
        arguments = shlex.split(line)[1:]
        if "--list" not in arguments:
            arguments += SHORTER.get(arguments[0], [])
        allowed = (0, 1) if "--fail-on-change" in arguments else (0,)
        assert executed(arguments) in allowed, line
    for path in tmp_path.rglob("[!.]*.json"):
        document = json.loads(path.read_text("utf-8"))
        if "sccal_version" in document and schema_file(document).exists():
            held_to_its_schema(document)


def executed(arguments: list[str]) -> int:
    """Exit code of one command."""
    err = io.StringIO()
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.redirect_stderr(err),
    ):
        patch.setattr(sys, "argv", ["sccal", *arguments])
        with pytest.raises(SystemExit) as caught:
            main()
    if caught.value.code:
        sys.stderr.write(err.getvalue())
    return int(caught.value.code or 0)


def test_links_between_pages_lead_somewhere():
    for page in PAGES:
        for target in re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text(encoding="utf-8")):
            if not (ROOT / "docs" / "drives.svg").exists() and target == "drives.svg":
                continue
            assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_effects_are_written_from_the_catalogue():
    sys.path.insert(0, str(ROOT / "docs"))
    try:
        from effects import page  # type: ignore[import-not-found]
    finally:
        sys.path.pop(0)
    assert (ROOT / "docs" / "effects.md").read_text(encoding="utf-8") == page()
