"""Finding runs in folders, and reading them whole."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from sccal.errors import DataError, UsageError
from sccal.logs.run import discover, read_run

LOGS = Path(__file__).resolve().parents[2].parent / "shared" / "logs"
VEHICLE = "[nominal]\nwheel_radius_m = 0.08\ntrack_m = 0.7\n[encoder]\nticks_per_rev = 1000\n"


def make_run(folder: Path, vehicle: bool = True) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "encoder.csv").write_text("t,left_ticks,right_ticks\n0,0,0\n0.1,1,1\n0.2,2,2\n")
    (folder / "ahrs.csv").write_text("t,yaw_deg\n0,1\n0.1,1\n")
    (folder / "gnss.csv").write_text("t,lat_deg,lon_deg\n0,52,5\n0.1,52,5\n")
    if vehicle:
        (folder / "vehicle.toml").write_text(VEHICLE)
    return folder


def names(*paths: Path) -> list[str]:
    return [source.name for source in discover(paths)]


def test_one_run_is_named_by_its_folder(tmp_path: Path) -> None:
    folder = make_run(tmp_path / "field 1")
    run = read_run(discover([folder])[0])
    assert (run.name, run.path, run.vehicle.name) == ("field 1", folder, "field 1")
    assert run.wheels.t_s.size == 3
    assert not run.notices


def test_runs_at_any_depth_in_natural_order(tmp_path: Path) -> None:
    for name in ("run10", "run2", "b/run1", "b/.hidden/run", "a"):
        make_run(tmp_path / name)
    assert names(tmp_path) == ["a", "b/run1", "run2", "run10"]


def test_results_are_not_runs(tmp_path: Path) -> None:
    make_run(tmp_path / "run")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "calibration.json").write_text("{}")
    (tmp_path / "out" / "gnss.csv").write_text("")
    assert names(tmp_path) == ["run"]


def test_symlink_loops_end(tmp_path: Path) -> None:
    make_run(tmp_path / "logs" / "run")
    (tmp_path / "logs" / "run" / "again").symlink_to(tmp_path / "logs")
    assert names(tmp_path / "logs") == ["run"]


def test_names_are_unique_across_roots(tmp_path: Path) -> None:
    for name in ("mon/run", "tue/run", "x/tue/run"):
        make_run(tmp_path / name)
    assert names(tmp_path / "mon", tmp_path / "tue", tmp_path / "x" / "tue") == ["mon/run", "tue/run", "tue/run-2"]
    assert names(tmp_path / "mon", tmp_path / "mon" / "run") == ["run"]


def test_the_nearest_vehicle_up_to_the_root_applies(tmp_path: Path) -> None:
    make_run(tmp_path / "logs" / "a" / "run", vehicle=False)
    (tmp_path / "logs" / "vehicle.toml").write_text(VEHICLE)
    assert discover([tmp_path / "logs"])[0].vehicle_toml == tmp_path / "logs" / "vehicle.toml"
    (tmp_path / "logs" / "a" / "vehicle.toml").write_text(VEHICLE)
    assert discover([tmp_path / "logs"])[0].vehicle_toml == tmp_path / "logs" / "a" / "vehicle.toml"
    (tmp_path / "logs" / "a" / "vehicle.toml").unlink()
    source = discover([tmp_path / "logs" / "a"])[0]
    assert source.vehicle_toml is None
    with pytest.raises(DataError, match=r"no vehicle\.toml here or above, up to") as caught:
        read_run(source)
    assert "wheel_radius_m = 0.08" in str(caught.value)


def test_for_a_run_given_alone_the_folder_just_above_counts_too(tmp_path: Path) -> None:
    make_run(tmp_path / "logs" / "run", vehicle=False)
    (tmp_path / "vehicle.toml").write_text(VEHICLE)
    assert discover([tmp_path / "logs" / "run"])[0].vehicle_toml is None
    (tmp_path / "logs" / "vehicle.toml").write_text(VEHICLE)
    assert discover([tmp_path / "logs" / "run"])[0].vehicle_toml == (tmp_path / "logs" / "vehicle.toml").resolve()


def test_a_file_of_a_run_stands_for_its_folder(tmp_path: Path) -> None:
    folder = make_run(tmp_path / "run")
    assert names(folder / "encoder.csv") == ["run"]


def test_other_files_are_no_run_folders(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("")
    with pytest.raises(DataError, match="is not a run folder"):
        discover([tmp_path / "notes.txt"])


def test_a_folder_and_a_file_of_one_name_are_two_runs(tmp_path: Path) -> None:
    make_run(tmp_path / "logs" / "run")
    (tmp_path / "logs" / "run.mcap").write_bytes(b"")
    assert names(tmp_path / "logs") == ["run", "run.mcap"]
    make_run(tmp_path / "others" / "run")
    assert names(tmp_path / "logs", tmp_path / "others") == ["logs/run", "logs/run.mcap", "others/run"]


def test_no_such_path_and_no_run(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such file"):
        discover([tmp_path / "missing"])
    with pytest.raises(DataError, match="no run in this folder"):
        discover([tmp_path])
    with pytest.raises(UsageError, match="no path"):
        discover([])


def test_missing_streams_are_named(tmp_path: Path) -> None:
    folder = make_run(tmp_path / "run")
    (folder / "ahrs.csv").unlink()
    (folder / "gnss.csv").unlink()
    with pytest.raises(DataError, match=r"lacks ahrs\.csv, gnss\.nmea \(or gnss\.csv\); found encoder\.csv"):
        read_run(discover([folder])[0])


def test_too_few_rows_say_why(tmp_path: Path) -> None:
    folder = make_run(tmp_path / "run")
    (folder / "ahrs.csv").write_text("t,yaw_deg\n0,1\n1,x\n2,y\n")
    with pytest.raises(DataError, match=r"ahrs\.csv: 1 usable rows, at least 2 are needed: 2 rows with unreadable"):
        read_run(discover([folder])[0])


def test_both_gnss_files_read_the_nmea(tmp_path: Path) -> None:
    folder = make_run(tmp_path / "run")
    (folder / "gnss.nmea").write_text(
        "$GNGGA,120000.00,5206,N,00518,E,4,12,0.6,40,M,44,M,,\n$GNGGA,120001.00,5206,N,00518,E,4,12,0.6,40,M,44,M,,\n"
    )
    run = read_run(discover([folder])[0])
    assert run.fixes.quality.tolist() == [4, 4]
    assert any(notice.source == "gnss.csv" for notice in run.notices)


BOGUS_ROWS = {
    "psu-van/2024-08-05-14-45-26": 1,
    "psu-van/2024-08-05-15-12-43": 1,
    "psu-van/2024-08-05-15-34-51": 1,
    "psu-van/2024-08-05-15-53-44": 0,
    "psu-van/2024-08-05-16-47-33": 1,
    "psu-van/2024-08-05-17-39-12": 0,
    "psu-van/2024-08-05-17-51-18": 97,
    "husky/test1": 0,
}


@pytest.mark.measured
@pytest.mark.skipif(not LOGS.is_dir(), reason="no measured logs beside the checkout")
@pytest.mark.parametrize("name", sorted(BOGUS_ROWS))
def test_measured_runs(name: str) -> None:
    sources = {source.name: source for source in discover([LOGS])}
    assert sources.keys() >= BOGUS_ROWS.keys()
    run = read_run(sources[name])
    assert sum(notice.count for notice in run.notices if "bogus" in notice.what) == BOGUS_ROWS[name]
    wheels, fixes = run.wheels, run.fixes
    for angle in (wheels.left_rad, wheels.right_rad):
        travel_m = np.diff(angle) * run.vehicle.wheel_radius_m
        since_s = np.arange(wheels.t_s[0], wheels.t_s[-1], 0.5)
        speed_mps = np.diff(np.interp(since_s, wheels.t_s, angle)) * run.vehicle.wheel_radius_m / 0.5
        assert np.abs(speed_mps).max() < 16
        assert np.abs(travel_m[~wheels.loose[1:]]).max() < 1.6
    gnss = run.path / "gnss.nmea"
    if gnss.exists():
        assert fixes.lat_deg.size == gnss.read_bytes().count(b"GGA,")
        assert fixes.utc_has_date
        np.testing.assert_allclose(fixes.host_t_s - fixes.host_t_s[0], fixes.utc_s - fixes.utc_s[0], atol=0.5)
        assert (fixes.quality == 4).mean() > 0.98
    else:
        assert fixes.lat_deg.size == 989


@pytest.mark.measured
@pytest.mark.skipif(not LOGS.is_dir(), reason="no measured logs beside the checkout")
def test_a_measured_run_cut_anywhere_still_reads(tmp_path: Path) -> None:
    source = discover([LOGS / "psu-van"])[0]
    shutil.copy(LOGS / "psu-van" / "vehicle.toml", tmp_path)
    for cut in (0.31, 0.777):
        for name in ("encoder.csv", "ahrs.csv", "gnss.nmea"):
            data = (source.path / name).read_bytes()
            (tmp_path / name).write_bytes(data[: int(cut * len(data))])
        run = read_run(discover([tmp_path])[0])
        assert not run.wheels.loose.any()
        assert run.fixes.lat_deg.size > 400


def test_capitals_in_the_names_of_files_do_not_matter(tmp_path: Path) -> None:
    folder = tmp_path / "monday"
    folder.mkdir()
    (folder / "Encoder.csv").write_text("t,left_ticks,right_ticks\n0,1,2\n1,2,3\n2,3,4\n")
    (folder / "AHRS.CSV").write_text("t,yaw_deg\n0,1\n1,2\n2,3\n")
    (folder / "vehicle.toml").write_text(VEHICLE)
    (folder / "gps.csv").write_text("t,lat_deg,lon_deg\n0,1,2\n1,1,2\n")
    source = discover([tmp_path])[0]
    with pytest.raises(DataError, match=r"lacks gnss\.nmea.*found encoder\.csv, ahrs\.csv; not read: gps\.csv"):
        read_run(source)
    (folder / "gps.csv").rename(folder / "GNSS.csv")
    assert read_run(discover([tmp_path])[0]).wheels.t_s.size == 3


@pytest.mark.parametrize(
    ("name", "advice"),
    [
        ("flight.bin", "ArduPilot"),
        ("run.bag.active", "rosbag reindex"),
        ("a/wheels.csv.zst", "zstd -d"),
        ("imu.csv", ""),
    ],
)
def test_a_folder_without_a_run_says_what_lies_there(tmp_path: Path, name: str, advice: str) -> None:
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_bytes(b"x")
    with pytest.raises(DataError, match=rf"found {name}.*{advice}"):
        discover([tmp_path])
