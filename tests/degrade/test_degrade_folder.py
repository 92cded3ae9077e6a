"""Whole runs degraded: files, manifest, reference, the command, and the same faults in memory."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from sccal.cli import main
from sccal.degrade.faults import Faults, fault_run
from sccal.degrade.paths import degrade_paths
from sccal.errors import DataError, UsageError
from sccal.geodesy import TangentPlane
from sccal.logs.run import discover, read_run
from sccal.logs.streams import Run
from sccal.simulate.choose import settings_from
from sccal.simulate.files import write_run, write_vehicle_file
from sccal.simulate.run import simulate_run

MEASURED = Path(__file__).parents[3] / "shared" / "logs"
GNSS = "gnss.nmea"


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two runs of one vehicle and things beside them."""
    root = tmp_path_factory.mktemp("campaign") / "logs"
    for name, seed in (("day1/run1", 1), ("day1/run2", 2)):
        chosen = settings_from(
            ["drive.path=general", "drive.duration_s=90", "encoder.rate_hz=20", "ahrs.rate_hz=10", "gnss.rate_hz=10"],
            seed,
        )
        write_run(simulate_run(chosen), root / name)
        write_vehicle_file(chosen, root)
    (root / "day1/run1/photos").mkdir()
    (root / "day1/run1/photos/a.jpg").write_bytes(b"\0\1\2")
    (root / "day1/run1/notes.txt").write_bytes(b"wet\r\ngrass")
    return root


def degrade(paths: Path | list[Path], out: Path, faults: Faults) -> None:
    _, failures = degrade_paths([paths] if isinstance(paths, Path) else paths, out, faults, lambda *_: None)
    if failures:
        raise failures[0].error


def files_of(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()
    }


def own(name: str) -> bool:
    return not name.endswith(("degrade.json", "reference.csv"))


def read(folder: Path, name: str) -> Run:
    return next(read_run(source) for source in discover([folder]) if source.name == name)


def command(*arguments: object) -> tuple[int, str, str]:
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        patch.setattr(sys, "argv", ["sccal", *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            main()
    return int(caught.value.code or 0), out.getvalue(), err.getvalue()


def test_without_a_fault_every_file_is_as_it_was(logs: Path, tmp_path: Path) -> None:
    degrade(logs, tmp_path, Faults())
    written = files_of(tmp_path)
    assert {name: text for name, text in written.items() if own(name)} == files_of(logs)
    manifest = json.loads(written["day1/run1/degrade.json"])
    assert manifest["schema"] == "sccal.degrade/1"
    assert manifest["notices"] == ["no fault given: the files are as they were"]
    assert all(one["sha256_before"] == one["sha256_after"] for one in manifest["files"])


def test_only_the_files_that_a_fault_concerns_change(logs: Path, tmp_path: Path) -> None:
    before = files_of(logs)
    for number, (faults, changed) in enumerate(
        (
            (Faults(sigma_m=5), GNSS),
            (Faults(heading_drift_deg_per_hour=60), "ahrs.csv"),
            (Faults(encoder_dropout=0.1), "encoder.csv"),
        )
    ):
        degrade(logs, tmp_path / str(number), faults)
        after = {name: text for name, text in files_of(tmp_path / str(number)).items() if own(name)}
        assert {name for name in before if before[name] != after[name]} == {f"day1/run{i}/{changed}" for i in (1, 2)}


def test_the_manifest_tells_what_was_done(logs: Path, tmp_path: Path) -> None:
    degrade(logs, tmp_path, Faults(sigma_m=5, losses_s=((20.0, 30.0),), outliers=0.05, seed=7))
    for name in ("day1/run1", "day1/run2"):
        folder = tmp_path / name
        manifest = json.loads((folder / "degrade.json").read_text())
        assert (manifest["run"], manifest["noise_stream"]) == (name, name)
        assert manifest["source"] == str(logs / name)
        assert manifest["options"]["seed"] == 7
        first, last = manifest["windows"]["encoder_span_s"]
        assert manifest["windows"]["loss_s"] == [[20.0, 30.0] if first <= 20 else [first + 20, first + 30]]
        counts = manifest["fixes"]
        assert counts["before"] == counts["same"] + counts["displaced"] + counts["lost"]
        assert counts["lost"] == pytest.approx(100, abs=1)
        for one in manifest["files"]:
            assert hashlib.sha256((folder / one["name"]).read_bytes()).hexdigest() == one["sha256_after"]
            assert hashlib.sha256((logs / name / one["name"]).read_bytes()).hexdigest() == one["sha256_before"]
        (gnss,) = [one for one in manifest["files"] if one["name"] == GNSS]
        assert gnss["sentences"]["rewritten"]["GGA"] == counts["before"]
        assert set(gnss["sentences"]["left"]) == {"ZDA"}
        assert last > first


def test_the_reference_is_what_was_read_before(logs: Path, tmp_path: Path) -> None:
    degrade(logs, tmp_path, Faults(sigma_m=5, losses_s=((20.0, 30.0),), from_s=10.0))
    for name in ("day1/run1", "day1/run2"):
        fixes, run = read(logs, name).fixes, read(logs, name)
        rows = [line.split(",") for line in (tmp_path / name / "reference.csv").read_text().splitlines()]
        assert rows[0] == ["t", "lat_deg", "lon_deg", "quality", "state", "utc_s"]
        numbers = np.array([[float(cell) for i, cell in enumerate(row) if i != 4] for row in rows[1:]])
        np.testing.assert_allclose(numbers[:, 0], fixes.host_t_s, atol=1e-6)
        np.testing.assert_allclose(numbers[:, 1], fixes.lat_deg, atol=1e-12)
        np.testing.assert_allclose(numbers[:, 2], fixes.lon_deg, atol=1e-12)
        np.testing.assert_array_equal(numbers[:, 3], fixes.quality)
        np.testing.assert_allclose(numbers[:, 4], fixes.utc_s, atol=1e-6)
        start = run.wheels.t_s[0]
        state = np.array([row[4] for row in rows[1:]])
        t_s = fixes.host_t_s if start <= 10 else fixes.host_t_s - start
        np.testing.assert_array_equal(state == "lost", (t_s >= 20) & (t_s <= 30))
        np.testing.assert_array_equal(state == "same", t_s < 10)


def test_a_log_degraded_twice_keeps_its_first_reference(logs: Path, tmp_path: Path) -> None:
    degrade(logs / "day1/run1", tmp_path / "once", Faults(losses_s=((20.0, 30.0),)))
    shutil.copy(logs / "vehicle.toml", tmp_path / "once/vehicle.toml")
    degrade(tmp_path / "once", tmp_path / "twice", Faults(sigma_m=5, losses_s=((50.0, 60.0),)))
    degrade(logs / "day1/run1", tmp_path / "at_once", Faults(sigma_m=5, losses_s=((20.0, 30.0), (50.0, 60.0))))
    twice, at_once = ((tmp_path / one / "run1/reference.csv").read_bytes() for one in ("twice", "at_once"))
    assert twice == at_once
    manifest = json.loads((tmp_path / "twice/run1/degrade.json").read_text())
    assert manifest["degraded_before"]["options"]["losses_s"] == [[20.0, 30.0]]


FAULTS = (
    Faults(sigma_m=5, losses_s=((20.0, 30.0),), seed=3),
    Faults(sigma_m=0.5, multipath_m=2, tau_s=10, outliers=0.1, from_s=15.0),
    Faults(latency_s=0.37),
    Faults(latency_s=-0.25, quality=2, sigma_m=0.1, losses_s=((5.0, 6.0), (40.0, 60.0)), drop=True),
    Faults(heading_drift_deg_per_hour=60, encoder_dropout=0.1),
    Faults(sigma_m=1, gst=True),
)


@pytest.mark.parametrize("faults", FAULTS)
def test_memory_and_files_agree(logs: Path, tmp_path: Path, faults: Faults) -> None:
    degrade(logs, tmp_path, faults)
    before = read(logs, "day1/run2")
    after = read(tmp_path, "day1/run2")
    run, original = fault_run(before, faults)
    assert original is before.fixes
    np.testing.assert_array_equal(run.fixes.utc_s, after.fixes.utc_s)
    plane = TangentPlane(float(original.lat_deg[0]), float(original.lon_deg[0]))
    for mine, theirs in zip(
        plane.to_east_north(run.fixes.lat_deg, run.fixes.lon_deg),
        plane.to_east_north(after.fixes.lat_deg, after.fixes.lon_deg),
        strict=True,
    ):
        np.testing.assert_allclose(mine, theirs, atol=1e-4)
    np.testing.assert_array_equal(run.fixes.quality, after.fixes.quality)
    np.testing.assert_allclose(run.fixes.sigma_east_m, after.fixes.sigma_east_m, atol=1e-4)
    np.testing.assert_allclose(run.fixes.extras["hdop"], after.fixes.extras["hdop"], atol=0.0051)
    np.testing.assert_array_equal(run.wheels.t_s, after.wheels.t_s)
    np.testing.assert_array_equal(run.wheels.left_rad, after.wheels.left_rad)
    np.testing.assert_array_equal(run.wheels.loose, after.wheels.loose)
    turn = np.angle(np.exp(1j * (run.heading.yaw_rad - after.heading.yaw_rad)))
    np.testing.assert_allclose(turn, 0, atol=1e-6)


def test_the_vehicle_goes_where_it_applies(logs: Path, tmp_path: Path) -> None:
    degrade(logs / "day1/run1", tmp_path / "a", Faults(sigma_m=1))
    assert (tmp_path / "a/run1" / GNSS).is_file()
    assert not (tmp_path / "a/vehicle.toml").exists()
    campaign = tmp_path / "campaign"
    shutil.copytree(logs / "day1/run1", campaign / "run1")
    shutil.copy(logs / "vehicle.toml", campaign / "vehicle.toml")
    degrade(campaign / "run1", tmp_path / "b", Faults(sigma_m=1))
    assert (tmp_path / "b/vehicle.toml").read_bytes() == (logs / "vehicle.toml").read_bytes()
    degrade(logs, tmp_path / "c", Faults(sigma_m=1))
    assert (tmp_path / "c/vehicle.toml").read_bytes() == (logs / "vehicle.toml").read_bytes()
    (tmp_path / "b/vehicle.toml").write_text("name = 'other'\n")
    degrade(campaign / "run1", tmp_path / "b", Faults(sigma_m=1))
    assert (tmp_path / "b/run1/vehicle.toml").read_bytes() == (logs / "vehicle.toml").read_bytes()
    assert (tmp_path / "b/vehicle.toml").read_text() == "name = 'other'\n"


def test_it_never_writes_over_logs(logs: Path, tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(logs)
    inside = tmp_path / "out"
    inside.mkdir()
    (inside / "run1").symlink_to(logs / "day1/run1")
    for paths, out in (
        (logs, logs),
        (logs, logs / "day1"),
        (logs, logs / "bad"),
        (logs / "day1", logs),
        (logs, link / "new"),
        (link, logs / "new"),
        (logs / "day1/run1", inside),
    ):
        with pytest.raises(UsageError, match="overlaps with the logs"):
            degrade(paths, out, Faults(sigma_m=1))
    assert not (logs / "bad").exists()


def test_only_its_own_results_are_replaced(logs: Path, tmp_path: Path) -> None:
    run = logs / "day1/run1"
    degrade(run, tmp_path, Faults(sigma_m=1))
    (tmp_path / "run1/mine.txt").write_text("kept")
    first = (tmp_path / "run1" / GNSS).read_bytes()
    degrade(run, tmp_path, Faults(sigma_m=2))
    assert (tmp_path / "run1" / GNSS).read_bytes() != first
    assert (tmp_path / "run1/mine.txt").read_text() == "kept"
    (tmp_path / "run1/degrade.json").unlink()
    with pytest.raises(UsageError, match="holds files that sccal degrade did not write"):
        degrade(run, tmp_path, Faults(sigma_m=1))
    assert not [name for name in files_of(tmp_path) if ".part" in name]


def test_one_bad_run_does_not_stop_the_others(logs: Path, tmp_path: Path) -> None:
    campaign = tmp_path / "logs"
    shutil.copytree(logs, campaign)
    (campaign / "day1/run1" / GNSS).write_text("nothing\n")
    code, out, err = command("degrade", campaign, "--out", tmp_path / "out", "--sigma", 5)
    assert code == 3
    assert "run1: not written" in out
    assert "run2: of" in out
    assert "no position fix" in err
    assert not (tmp_path / "out/day1/run1").exists()
    assert (tmp_path / "out/day1/run2" / GNSS).is_file()


def test_the_command(logs: Path, tmp_path: Path) -> None:
    options = ("--sigma", 5, "--loss", "20:30", "--loss", "50:60", "--from", 40, "--seed", 2)
    first = command("degrade", logs, "--out", tmp_path / "a", *options)
    assert (first[0], first[2]) == (0, "")
    assert "lost" in first[1]
    assert command("degrade", logs, "--out", tmp_path / "b", *options)[0] == 0
    assert files_of(tmp_path / "a") == files_of(tmp_path / "b")
    assert command("degrade", logs, "--out", tmp_path / "c")[0] == 0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--sigma", -1), "--sigma -1.0: must be 0 m or more"),
        (("--loss", "30:20"), "30:20"),
        (("--loss", "now"), "now"),
        (("--loss", "5000:6000"), "outside the run"),
        (("--from", 5000), "--from 5000: after the run, which lasts"),
        (("--quality", 10), "--quality 10: must be a GGA quality"),
        (("--outliers", 2), "--outliers 2.0: must be a fraction"),
        (("--encoder-dropout", 1), "--encoder-dropout 1.0"),
        (("--tau", 0), "--tau 0.0"),
    ],
)
def test_what_cannot_be_meant_is_refused(logs: Path, tmp_path: Path, options: tuple[object, ...], words: str) -> None:
    code, _, err = command("degrade", logs / "day1/run1", "--out", tmp_path / "out", *options)
    assert code == 2
    assert words in err
    assert "Traceback" not in err


def test_a_drift_needs_to_know_which_way_yaw_turns(logs: Path, tmp_path: Path) -> None:
    shutil.copytree(logs / "day1/run1", tmp_path / "x/run1")
    with pytest.raises(DataError, match=r"no vehicle\.toml"):
        degrade(tmp_path / "x", tmp_path / "out", Faults(heading_drift_deg_per_hour=5))
    degrade(tmp_path / "x", tmp_path / "out", Faults(sigma_m=5))


@pytest.mark.measured
@pytest.mark.skipif(not MEASURED.is_dir(), reason="no measured logs beside the checkout")
@pytest.mark.parametrize("name", ["psu-van/2024-08-05-14-45-26", "husky/test1"])
def test_measured_logs(tmp_path: Path, name: str) -> None:
    degrade(MEASURED / name, tmp_path / "same", Faults())
    run = Path(name).name
    for file in (GNSS, "gnss.csv", "ahrs.csv", "encoder.csv"):
        if (MEASURED / name / file).is_file():
            assert (tmp_path / "same" / run / file).read_bytes() == (MEASURED / name / file).read_bytes()
    faults = Faults(sigma_m=5, losses_s=((60.0, 120.0),), heading_drift_deg_per_hour=30)
    degrade(MEASURED / name, tmp_path / "worse", faults)
    before, after = read(MEASURED / name, run), read(tmp_path / "worse", run)
    memory, _ = fault_run(before, faults)
    np.testing.assert_array_equal(memory.fixes.host_t_s, after.fixes.host_t_s)
    np.testing.assert_allclose(memory.fixes.lat_deg, after.fixes.lat_deg, atol=1e-9)
    np.testing.assert_allclose(memory.fixes.lon_deg, after.fixes.lon_deg, atol=1e-9)
    np.testing.assert_array_equal(memory.fixes.quality, after.fixes.quality)
    turned = np.unwrap(after.heading.yaw_rad - before.heading.yaw_rad)
    hours = (before.heading.t_s - before.heading.t_s[0]) / 3600
    sign = -1 if before.vehicle.convention == "ned" else 1
    np.testing.assert_allclose(np.degrees(turned), sign * 30 * hours, atol=1e-3)
