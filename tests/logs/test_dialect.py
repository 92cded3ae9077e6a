"""Tables as other programs write them: each is read as the contract's own would be, and told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sccal.errors import DataError
from sccal.logs.column_names import contract_names
from sccal.logs.table import Table, read_table

WHEELS = (("t", "left_ticks", "right_ticks"), ("t", "left_rad", "right_rad"))
HEADING = (("t", "yaw_deg"), ("t", "yaw_rad"))
FIXES = (("t", "lat_deg", "lon_deg"),)
PLAIN = "t,left_ticks,right_ticks\n1717243200.25,10,20\n1717243200.75,12,23\n1717243201.25,14,26\n"


def read(folder: Path, text: str | bytes, needs: tuple[tuple[str, ...], ...] = WHEELS) -> Table:
    path = folder / "table.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_table(path, needs)


COMMAS = PLAIN.replace(",", ";").replace(".", ",")
DIALECTS = {
    "decimal commas": COMMAS,
    "tabs": COMMAS.replace(";", "\t"),
    "quotes": "\n".join("\t".join(f'"{cell}"' for cell in line.split(";")) for line in COMMAS.splitlines()),
    "quoted commas": "\n".join(",".join(f'"{cell}"' for cell in line.split(";")) for line in COMMAS.splitlines()),
    "separator line": "sep=;\r\n" + COMMAS,
    "capitals": PLAIN.replace("t,left_ticks,right_ticks", "T,LEFT_TICKS,RIGHT_TICKS"),
    "units": PLAIN.replace("t,left_ticks,right_ticks", "Time [s],Left Ticks,Right Ticks"),
    "encoders": PLAIN.replace("t,left_ticks,right_ticks", "timestamp,enc_left,enc_right"),
    "milliseconds": "time_ms,l_counts,r_counts\n1717243200250,10,20\n1717243200750,12,23\n1717243201250,14,26\n",
    "nanoseconds": "t,left_ticks,right_ticks\n1717243200250000000,10,20\n1717243200750000000,12,23\n"
    "1717243201250000000,14,26\n",
    "utf-16": PLAIN.encode("utf-16"),
}
DIALECTS["ISO"] = (
    "t,left_ticks,right_ticks\n2024-06-01T12:00:00.250Z,10,20\n2024-06-01T12:00:00.750Z,12,23\n"
    "2024-06-01T12:00:01.250Z,14,26\n"
)
DIALECTS["date and time"] = DIALECTS["ISO"].replace("T", " ").replace("Z", "").replace("-", "/")
DIALECTS["German"] = DIALECTS["ISO"].replace("2024-06-01T", "01.06.2024 ").replace("Z", "")


@pytest.mark.parametrize("name", DIALECTS)
def test_a_dialect_is_read_as_the_plain_table(tmp_path: Path, name: str) -> None:
    got = read(tmp_path, DIALECTS[name])
    assert got.columns["t"] - 1717243200.0 == pytest.approx([0.25, 0.75, 1.25])
    assert got.columns["left_ticks"].tolist() == [10, 12, 14]
    assert got.columns["right_ticks"].tolist() == [20, 23, 26]
    assert got.notices or name == "utf-16"


def test_a_plain_table_needs_no_word(tmp_path: Path) -> None:
    assert not read(tmp_path, PLAIN).notices


def test_times_of_day_go_on_past_midnight(tmp_path: Path) -> None:
    rows = "".join(f"{clock},{i}\n" for i, clock in enumerate(("23:59:59.50", "23:59:59.75", "00:00:00.00")))
    got = read(tmp_path, "t,yaw_deg\n" + rows, HEADING)
    assert got.columns["t"] == pytest.approx([86399.5, 86399.75, 86400.0])
    assert "times of day" in got.notices[0].what


def test_rows_of_one_wheel_are_put_together(tmp_path: Path) -> None:
    rows = "".join(f"{0.1 * i:.2f},{10 * i},\n{0.1 * i + 0.05:.2f},,{20 * i + 10}\n" for i in range(6))
    got = read(tmp_path, "t,left_ticks,right_ticks\n" + rows)
    assert got.columns["left_ticks"].tolist() == [0, 10, 20, 30, 40, 50]
    assert got.columns["right_ticks"] == pytest.approx([10, 20, 40, 60, 80, 100])
    assert any("interpolated" in notice.what for notice in got.notices)


def test_bursts_are_spread_over_the_time_since_the_one_before(tmp_path: Path) -> None:
    rows = "".join(f"{0.1 * (i // 5 + 1):.1f},{i},{2 * i}\n" for i in range(30))
    got = read(tmp_path, "t,left_ticks,right_ticks\n" + rows)
    assert got.columns["t"] == pytest.approx(0.02 * np.arange(1, 31))
    assert any("bursts" in notice.what for notice in got.notices)


def test_seconds_without_fraction_are_spread_over_themselves(tmp_path: Path) -> None:
    rows = "".join(f"{int(0.2 * i + 1e-9)},{i},{2 * i}\n" for i in range(2, 30))
    got = read(tmp_path, "t,left_ticks,right_ticks\n" + rows)
    assert got.columns["t"] == pytest.approx(0.2 * np.arange(2, 30))
    assert any("lost their fraction" in notice.what for notice in got.notices)


def test_rows_written_twice_are_no_bursts(tmp_path: Path) -> None:
    rows = "".join(f"{0.1 * (i // 2):.1f},{i // 2},{i // 2}\n" for i in range(60))
    got = read(tmp_path, "t,left_ticks,right_ticks\n" + rows)
    assert got.columns["t"] == pytest.approx(0.1 * np.arange(30))


@pytest.mark.parametrize(("most", "unit"), [(3.0, "radians"), (170.0, "degrees")])
def test_a_heading_without_unit_is_taken_by_its_size_and_told(tmp_path: Path, most: float, unit: str) -> None:
    got = read(tmp_path, "time,Heading\n" + "".join(f"{i},{most * i / 9:.4f}\n" for i in range(10)), HEADING)
    assert got.columns["yaw_deg"][-1] == pytest.approx(np.degrees(most) if unit == "radians" else most)
    assert any(unit in notice.what for notice in got.notices)


def test_other_names_of_a_place_are_known() -> None:
    named = contract_names(["time", "Latitude", "lng", "altitude", "quality"], FIXES)
    assert named.names == ["t", "lat_deg", "lon_deg", "alt_m", "fix_quality"]
    assert contract_names(["t", "lat_deg", "lon_deg", "quality"], FIXES).names[-1] == "quality"


@pytest.mark.parametrize("head", ["t,left_rpm,right_rpm", "t,left,right", "t,left_mmps,right_mmps", "ms,a,b"])
def test_what_is_no_count_is_not_taken_for_one(tmp_path: Path, head: str) -> None:
    with pytest.raises(DataError, match="needs t,left_ticks,right_ticks"):
        read(tmp_path, f"{head}\n1,2,3\n2,3,4\n")
