"""Fixes of other programs: solution files of RTKLIB, and gpsd's reports."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from sccal.errors import DataError
from sccal.logs.folder import listed_folder
from sccal.logs.formats import NMEA
from sccal.logs.gpsd import read_gpsd
from sccal.logs.rtklib_pos import read_pos

NOON_S = datetime(2024, 6, 1, 12, tzinfo=UTC).timestamp()
REST = "height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) age(s) ratio"
ENDS = "450.1230   1  15   0.0120   0.0110   0.0240   0.0010   0.0000   0.0000   1.00   31.0"


def pos(folder: Path, head: str, *rows: str) -> Path:
    path = folder / "gnss.pos"
    path.write_text("\n".join(["% program : RTKPOST", head, *rows, ""]), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("clock", "when"),
    [("GPST", "2024/06/01 12:00:18.000"), ("UTC", "2024/06/01 12:00:00.000"), ("GPST", "2316 561618.000")],
)
def test_times_of_a_solution_file_are_utc(tmp_path: Path, clock: str, when: str) -> None:
    head = f"%  {clock}   latitude(deg) longitude(deg) {REST}"
    fixes, _ = read_pos(pos(tmp_path, head, f"{when}   47.400000001  -8.500000002  {ENDS}"))
    assert fixes.utc_s.tolist() == [NOON_S]
    assert fixes.utc_has_date
    assert (fixes.lat_deg[0], fixes.lon_deg[0]) == (47.400000001, -8.500000002)
    assert (fixes.sigma_north_m[0], fixes.sigma_east_m[0], fixes.cov_en_m2[0]) == pytest.approx((0.012, 0.011, 1e-6))


def test_degrees_minutes_and_seconds_keep_their_sign(tmp_path: Path) -> None:
    head = f"%  UTC   latitude(d'\") longitude(d'\") {REST}"
    fixes, _ = read_pos(pos(tmp_path, head, f"2024/06/01 12:00:00.0  47 24 18.0  -0 30 36.0  {ENDS}"))
    assert (fixes.lat_deg[0], fixes.lon_deg[0]) == pytest.approx((47.405, -0.51))


def test_qualities_are_rtklibs_and_odd_rows_are_told(tmp_path: Path) -> None:
    head = f"%  UTC   latitude(deg) longitude(deg) {REST}"
    rows = [f"2024/06/01 12:00:{k:02d}.0 47.4 8.5 450.0 {k} 15 0 0 0 0 0 0 1 1" for k in range(1, 7)]
    fixes, notices = read_pos(pos(tmp_path, head, *rows, "2024/06/01 12:00:07"))
    assert fixes.quality.tolist() == [4, 5, 9, 2, 1, 5]
    assert np.isnan(fixes.sigma_east_m).all()
    assert any(notice.count == 1 and notice.where == "line 9" for notice in notices)


@pytest.mark.parametrize("head", ["%  GPST  x-ecef(m) y-ecef(m) z-ecef(m) Q", "no header"])
def test_other_solution_files_say_what_to_write(tmp_path: Path, head: str) -> None:
    with pytest.raises(DataError, match=r"no header line.*lat/lon/height"):
        read_pos(pos(tmp_path, head, "2024/06/01 12:00:00.0 1 2 3 1"))


def reports(*given: dict[str, object]) -> str:
    return "".join(json.dumps(one) + "\n" for one in ({"class": "VERSION", "release": "3.25"}, *given))


TPV = {
    "class": "TPV",
    "mode": 3,
    "status": 3,
    "time": "2024-06-01T12:00:00.200Z",
    "lat": 47.4,
    "lon": -8.5,
    "alt": 450.1,
}


def test_reports_of_gpsd_are_read(tmp_path: Path) -> None:
    path = tmp_path / "gpsd.json"
    later = TPV | {"time": "2024-06-01T12:00:00.400Z", "status": 4, "eph": 2.448}
    path.write_text(
        reports(TPV, {"class": "SKY"}, {"class": "TPV", "mode": 1}, later) + '{"class": "TPV", "mo', "utf-8"
    )
    fixes, notices = read_gpsd(path)
    assert fixes.utc_s == pytest.approx([NOON_S + 0.2, NOON_S + 0.4])
    assert fixes.quality.tolist() == [4, 5]
    assert np.isnan(fixes.sigma_east_m[0])
    assert fixes.sigma_north_m[1] == pytest.approx(1.0)
    assert [notice.count for notice in notices] == [2, 1, 1]


def test_reports_without_a_place_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "gpsd.json"
    path.write_text(reports({"class": "TPV", "mode": 1}), "utf-8")
    with pytest.raises(DataError, match=r"none of 1 reports of class TPV holds a time, lat and lon"):
        read_gpsd(path)


@pytest.mark.parametrize("name", ["gpsd.json", "rover_20240601.pos"])
def test_a_folder_takes_its_fixes_from_the_only_file_of_another_program(tmp_path: Path, name: str) -> None:
    (tmp_path / "encoder.csv").touch()
    (tmp_path / name).touch()
    assert listed_folder(tmp_path).fix_file == name
    (tmp_path / "second.pos").touch()
    assert listed_folder(tmp_path).fix_file == ""
    (tmp_path / "gnss.csv").touch()
    assert listed_folder(tmp_path).fix_file == "gnss.csv"


def test_reports_under_the_name_of_sentences_are_read(tmp_path: Path) -> None:
    path = tmp_path / "gnss.nmea"
    path.write_text(reports(TPV, TPV | {"time": "2024-06-01T12:00:01Z"}), "utf-8")
    assert NMEA.fixes is not None
    fixes, _ = NMEA.fixes(path)
    assert fixes.lat_deg.size == 2
