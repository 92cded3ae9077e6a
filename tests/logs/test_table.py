"""CSV files as loggers leave them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from sccal.errors import DataError, SccalError
from sccal.logs.ahrs import read_ahrs
from sccal.logs.encoder import read_encoder
from sccal.logs.gnss_csv import read_gnss_csv
from sccal.logs.nmea import read_nmea
from sccal.logs.streams import Notice, Vehicle
from sccal.logs.table import Table, read_table
from sccal.logs.vehicle import read_vehicle

ROBOT = Vehicle("robot", Path("vehicle.toml"), 0.08, 0.7, 32768.0)


def table(folder: Path, data: bytes | str) -> Table:
    path = folder / "ahrs.csv"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return read_table(path, (("t", "yaw_deg"), ("t", "yaw_rad")))


def found(notices: tuple[Notice, ...], words: str) -> Notice:
    matches = [notice for notice in notices if words in notice.what]
    assert len(matches) == 1, [str(notice) for notice in notices]
    return matches[0]


def stamps(folder: Path, times: list[float]) -> Table:
    return table(folder, "t,yaw_deg\n" + "".join(f"{t:.3f},{i}\n" for i, t in enumerate(times)))


def test_a_plain_file_gives_every_row_and_its_line(tmp_path: Path) -> None:
    got = table(tmp_path, "t,yaw_deg,motor_current_a\n0.1,10.5,1\n0.2,11.5,\n0.3,12.5,3\n")
    assert got.columns["yaw_deg"].tolist() == [10.5, 11.5, 12.5]
    assert got.line.tolist() == [2, 3, 4]
    assert np.isnan(got.columns["motor_current_a"][1])
    assert not got.notices


@pytest.mark.parametrize(
    "data",
    [
        b"\xef\xbb\xbft,yaw_deg\r\n1,2\r\n3,4\r\n",
        b" t , yaw_deg \n1, 2\n 3,4\n",
        b"t,yaw_deg\r1,2\r3,4\r",
        b"# logged by robot\n\nt,yaw_deg\n1,2\n\n3,4\n\n",
        b"t;yaw_deg\n1;2\n3;4\n",
        b"t\tyaw_deg\n1\t2\n3\t4",
        b't,"yaw_deg"\n"1","2"\n3,4\n',
        b"t,yaw_deg\n1,2,\n3,4,\n",
        b"t,yaw_deg,\n1,2,\n3,4,\n",
        b"t,yaw_deg\n1,2\n# restarted, by hand\n3,4\n",
    ],
)
def test_dialects(tmp_path: Path, data: bytes) -> None:
    got = table(tmp_path, data)
    assert got.columns["t"].tolist() == [1, 3]
    assert got.columns["yaw_deg"].tolist() == [2, 4]


@pytest.mark.parametrize("bad", ["x", "", "inf", "-inf", "nan", "1e999", "1_0", "0x10", "\0\0", "\x80"])
def test_rows_with_unreadable_required_cells_are_dropped_and_counted(tmp_path: Path, bad: str) -> None:
    data = f"t,yaw_deg\n0,1\n1,{bad}\n2,3\n{bad},4\n4,5\n".encode("latin-1")
    got = table(tmp_path, data)
    assert got.columns["yaw_deg"].tolist() == [1, 3, 5]
    assert got.line.tolist() == [2, 4, 6]
    notice = found(got.notices, "unreadable or empty")
    assert (notice.count, notice.where) == (2, "line 3")


def test_text_in_further_columns_is_empty_and_a_text_column_is_left_out(tmp_path: Path) -> None:
    got = table(tmp_path, "t,yaw_deg,mode,load\n0,1,auto,5\n1,2,auto,off\n2,3,hand,7\n")
    assert "mode" not in got.columns
    assert got.columns["yaw_deg"].size == 3
    np.testing.assert_array_equal(got.columns["load"], [5, np.nan, 7])
    assert "mode" in found(got.notices, "without numbers").what
    assert found(got.notices, "further columns").where == "line 3"


def test_infinite_cells_of_further_columns_are_empty(tmp_path: Path) -> None:
    got = table(tmp_path, "t,yaw_deg,load\n0,1,5\n1,2,inf\n2,3,-inf\n")
    np.testing.assert_array_equal(got.columns["load"], [5, np.nan, np.nan])
    assert found(got.notices, "further columns").count == 2


def test_short_and_long_rows(tmp_path: Path) -> None:
    got = table(tmp_path, "t,yaw_deg,x\n0,1,1\n1\n2,3\n3,4,1,9,9\n4,5,1\n")
    assert got.columns["t"].tolist() == [0, 2, 4]
    assert found(got.notices, "more than 3 cells").where == "line 5"
    assert found(got.notices, "unreadable or empty").count == 2


@pytest.mark.parametrize(("last", "kept"), [("2.0000,31.7", False), ("2.00", False), ("2.0000,31.7500", True)])
def test_a_last_line_cut_in_the_middle_is_dropped(tmp_path: Path, last: str, kept: bool) -> None:
    got = table(tmp_path, f"t,yaw_deg\n0.0000,30.1000\n1.0000,30.2000\n{last}")
    assert got.columns["t"].size == (3 if kept else 2)
    if not kept:
        assert found(got.notices, "cut").where == "line 4"


def test_a_cut_count_is_dropped(tmp_path: Path) -> None:
    path = tmp_path / "encoder.csv"
    path.write_text("t,left_ticks,right_ticks\n0,5000,5000\n1,5001,5001\n2,5002,50")
    stream, notices = read_encoder(path, ROBOT)
    assert stream.t_s.tolist() == [0, 1]
    assert found(notices, "cut").count == 1


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "empty"),
        (b"\n\n \n", "blanks"),
        (b"\0" * 5000, "blanks"),
        (b"t,course\n1,2\n", "needs t,yaw_deg or t,yaw_rad; it has t,course"),
        (b"t,yaw,heading\n1,2,3\n", "needs t,yaw_deg or t,yaw_rad; it has t,yaw,heading"),
        (b"0.1,12.5\n0.2,12.6\n", "needs t,yaw_deg"),
        (b"t,yaw_deg\n", "no usable row"),
        (b"t,yaw_deg\nx,y\n", "no usable row of 1"),
        (b"# only a comment\n", "no header"),
        (b"t,yaw_deg\n".decode().encode("utf-16"), "no usable row"),
        (b"7" * 3_000_000, "without a line end"),
        (b",".join(b"c%d" % i for i in range(5000)) + b"\n", "5000 columns"),
        (b"t,yaw_deg\n" + b"," * 3_000_000 + b"\n", "lines of more than 64 kB"),
        (b"t,yaw_deg\n" + b"," * 3000 + b"\n" + b"," * 3000 + b"\n", "3001 cells"),
        (b"t,yaw_deg\n1,2,3\n2,3,4\n3,4,5\n", "name them all"),
    ],
)
def test_hopeless_files_are_one_line_errors(tmp_path: Path, data: bytes, words: str) -> None:
    with pytest.raises(DataError) as caught:
        table(tmp_path, data)
    assert words in str(caught.value)
    assert "ahrs.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="cannot be read"):
        read_table(tmp_path / "ahrs.csv", (("t", "yaw_deg"),))


def test_repeated_times_keep_the_first(tmp_path: Path) -> None:
    got = stamps(tmp_path, [0, 1, 1, 1, 2])
    assert got.columns["yaw_deg"].tolist() == [0, 1, 4]
    assert found(got.notices, "seen before").count == 2


def test_rows_swapped_by_buffering_are_sorted(tmp_path: Path) -> None:
    got = stamps(tmp_path, [0, 0.1, 0.3, 0.2, 0.4, 0.6, 0.5, 0.7])
    assert got.columns["yaw_deg"].tolist() == [0, 1, 3, 2, 4, 6, 5, 7]
    assert found(got.notices, "out of order").count == 2


def test_a_clock_that_steps_back_loses_rows_until_time_passes(tmp_path: Path) -> None:
    first = np.arange(0, 100, 0.1)
    second = np.arange(95.05, 200, 0.1)
    got = stamps(tmp_path, [*first, *second])
    assert len(got.notices) == 1
    notice = got.notices[0]
    assert (notice.count, notice.where, notice.severity) == (49, f"line {first.size + 2}", "warning")
    assert "stepped back by 4.850 s" in notice.what
    assert got.columns["t"].size == first.size + second.size - 49
    assert got.columns["yaw_deg"].tolist() == [*range(first.size), *range(first.size + 49, first.size + second.size)]


@pytest.mark.parametrize("stamp", [2147483647.0, 0.0, -5e8, 1e12])
@pytest.mark.parametrize("rows", [1, 3])
def test_absurd_stamps_do_not_swallow_the_rest(tmp_path: Path, stamp: float, rows: int) -> None:
    times = 1.7e9 + np.arange(0, 100, 0.1)
    times[400 : 400 + rows] = stamp + 0.1 * np.arange(rows)
    got = stamps(tmp_path, times.tolist())
    assert got.columns["t"].size == times.size - rows
    notice = found(got.notices, "bad stamps")
    assert (notice.count, notice.where, notice.severity) == (rows, "line 402", "warning")


@pytest.mark.parametrize("place", [0, -1])
def test_an_absurd_first_or_last_stamp_is_dropped(tmp_path: Path, place: int) -> None:
    times = 1.7e9 + np.arange(0, 100, 0.1)
    times[place] = 0.0 if place == 0 else 2147483647.0
    got = stamps(tmp_path, times.tolist())
    assert got.columns["t"].size == times.size - 1
    assert found(got.notices, "more than a day").count == 1


def test_a_stamp_some_seconds_ahead_costs_one_row(tmp_path: Path) -> None:
    times = np.arange(0, 100, 0.1)
    times[300] += 5
    got = stamps(tmp_path, times.tolist())
    assert got.columns["t"].size == times.size - 1


def test_a_clock_set_in_mid_run_is_carried_on(tmp_path: Path) -> None:
    got = stamps(tmp_path, [*np.arange(0, 10, 0.1), *(1.7e9 + np.arange(0, 50, 0.1))])
    assert np.diff(got.columns["t"]) == pytest.approx(np.full(599, 0.1), abs=1e-3)
    assert got.columns["t"][-1] == pytest.approx(1.7e9 + 49.9)
    assert found(got.notices, "step of the clock (it was set)").where == "line 102"


def test_times_that_are_all_in_2038_are_just_times(tmp_path: Path) -> None:
    got = stamps(tmp_path, (2147483600 + np.arange(0, 100, 0.1)).tolist())
    assert got.columns["t"].size == 1000
    assert not got.notices


def test_a_pause_of_hours_is_no_fault(tmp_path: Path) -> None:
    got = stamps(tmp_path, [*np.arange(0, 10, 0.1), *np.arange(7200, 7210, 0.1)])
    assert got.columns["t"].size == 200
    assert not got.notices


@settings(max_examples=60)
@given(st.lists(st.floats(-1e10, 1e10) | st.integers(0, 50).map(float), min_size=1, max_size=40))
def test_any_times_become_strictly_increasing(tmp_path_factory: pytest.TempPathFactory, times: list[float]) -> None:
    try:
        got = stamps(tmp_path_factory.mktemp("run"), times)
    except DataError as error:
        refused = re.search(rf"\d+ of {len(times)} rows are out of order in time", str(error))
        if refused and len(times) > 20:
            return
        raise
    assert (np.diff(got.columns["t"]) > 0).all()
    assert got.columns["t"].size + sum(n.count for n in got.notices if "sorted" not in n.what) == len(times)
    written = np.array([float(f"{t:.3f}") for t in times])
    np.testing.assert_array_equal(written[got.line - 2], got.columns["t"])


LINES = st.sampled_from(
    [
        b"t,yaw_deg\n",
        b"t,left_ticks,right_ticks\n",
        b"t,lat_deg,lon_deg,sigma_m\n",
        b"1.5,20,30\n",
        b"2.5,20,30,1\n",
        b"3,4\r\n",
        b"\xff\xfe\0,,\n",
        b'"\n',
        b"#\n",
        b"$GNGGA,120001.00,4051.7,N,07750.2,W,4,12,0.5,300,M,-34,M,,\n",
        b"$GNRMC,120001.00,A,4051.7,N,07750.2,W,1,2,010124,,,A\n",
        b"$GNGGA,,,,,,0,,,,,,,,\r\n",
        b"$$*",
        b"[nominal]\nwheel_radius_m = 1\ntrack_m = 1\n",
    ]
)
BYTES = st.binary(max_size=200) | st.lists(LINES | st.binary(max_size=12), max_size=8).map(b"".join)


@settings(max_examples=250)
@given(data=BYTES)
@example(data=b"t,yaw_deg\n1e400,1\n")
@example(data=b"t,left_ticks,right_ticks\n0,99999999999999999999,1\n1,2,3")
@example(data=b"$")
@example(data=b"$GPGGA,*")
@example(data=b"[nominal]\nwheel_radius_m = 1" + b"0" * 5000)
def test_any_bytes_give_a_stream_or_a_known_error(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    folder = tmp_path_factory.getbasetemp()
    path = folder / "any.csv"
    path.write_bytes(data)
    for read in (lambda p: read_encoder(p, ROBOT), read_ahrs, read_gnss_csv, read_nmea, read_vehicle):
        message = "any.csv"
        try:
            read(path)
        except SccalError as error:
            message = str(error)
        assert "\n" not in message
        assert "any.csv" in message
