"""CSV logs degraded: cells and rows that a fault concerns, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sccal.degrade.faults import Faults
from sccal.degrade.tables import degrade_ahrs_csv, degrade_encoder_csv, degrade_gnss_csv
from sccal.errors import DataError

SPAN = (100.0, 200.0)
HEADER = b"t,lat_deg,lon_deg,alt_m,fix_quality,sigma_m\n"


def fixes(count: int = 60) -> bytes:
    return HEADER + b"".join(
        b"%.2f,%.7f,%.7f,12.500,4,0.0150\n" % (100 + i, 52 + 1e-5 * i, 5 + 1e-5 * i) for i in range(count)
    )


def cells(raw: bytes) -> list[list[bytes]]:
    return [line.split(b",") for line in raw.splitlines()]


def test_only_position_quality_and_sigma_change() -> None:
    done = degrade_gnss_csv(fixes(), Faults(sigma_m=5), SPAN, "run")
    before, after = cells(fixes()), cells(done.raw)
    assert [[row[0], row[3]] for row in before] == [[row[0], row[3]] for row in after]
    assert {row[4] for row in after[1:]} == {b"1"}
    assert {row[5] for row in after[1:]} == {b"5.0000"}
    assert all(len(cell.split(b".")[1]) == 10 for row in after[1:] for cell in row[1:3])
    north_m = (np.array([float(row[1]) for row in after[1:]]) - [float(row[1]) for row in before[1:]]) * 111_260
    np.testing.assert_allclose(north_m, done.fixes.north_m, rtol=1e-3, atol=1e-3)


def test_lost_rows_keep_their_place_where_a_column_can_say_so() -> None:
    done = cells(degrade_gnss_csv(fixes(), Faults(losses_s=((110.0, 120.0),)), SPAN, "run").raw)
    assert len(done) == 61
    assert done[11:22] == [[b"%.2f" % (110 + i), b"", b"", b"", b"0", b""] for i in range(11)]
    assert done[:11] + done[22:] == cells(fixes())[:11] + cells(fixes())[22:]
    dropped = degrade_gnss_csv(fixes(), Faults(losses_s=((110.0, 120.0),), drop=True), SPAN, "run").raw
    assert cells(dropped) == cells(fixes())[:11] + cells(fixes())[22:]


def test_lost_rows_go_where_no_column_can_say_so() -> None:
    text = b"t,lat_deg,lon_deg\n" + b"".join(b"%d,52.0,5.0\n" % (100 + i) for i in range(20))
    done = degrade_gnss_csv(text, Faults(losses_s=((5.0, 9.0),)), SPAN, "run")
    assert done.rows_dropped == 5
    assert [row[0] for row in cells(done.raw)[1:]] == [b"%d" % t for t in (*range(100, 105), *range(110, 120))]


def test_quotes_blanks_separators_and_unreadable_rows_stay() -> None:
    text = (
        b'\xef\xbb\xbf# by a logger\r\n\r\n"lon_deg"; t ;name;lat_deg\r\n'
        b'"5.1"; 100.5 ;"here";  52.2\r\n5.1;101;there;\r\n# note; 1;2;3\r\n5.1;x;there;52.1\r\n5.1;102;x;52.1'
    )
    assert degrade_gnss_csv(text, Faults(), SPAN, "run").raw == text
    done = degrade_gnss_csv(text, Faults(sigma_m=5), SPAN, "run")
    assert done.fixes.displaced.sum() == 2
    lines = done.raw.split(b"\r\n")
    assert lines[:3] == text.split(b"\r\n")[:3]
    assert lines[4:7] == text.split(b"\r\n")[4:7]
    first = lines[3].split(b";")
    assert (first[1], first[2]) == (b" 100.5 ", b'"here"')
    assert first[0].startswith(b'"5.1')
    assert first[0].endswith(b'"')
    assert first[3].startswith(b"  52.2")
    assert b"5.1;" not in lines[7]


@pytest.mark.parametrize("lon", [179.9999999, -179.9999999, 359.9999999, 180.0000001])
def test_longitudes_stay_in_the_range_in_which_they_are_written(lon: float) -> None:
    text = b"t,lat_deg,lon_deg\n" + b"".join(b"%d,0.0,%.7f\n" % (100 + i, lon) for i in range(50))
    done = degrade_gnss_csv(text, Faults(sigma_m=5), SPAN, "run")
    written = np.array([float(row[2]) for row in cells(done.raw)[1:]])
    assert ((written >= 0) & (written <= 360)).all() if lon > 180 else (np.abs(written) <= 180).all()
    step_deg = (written - lon + 180) % 360 - 180
    np.testing.assert_allclose(step_deg * 111_319.49, done.fixes.east_m, atol=1e-3)


def test_late_fixes_in_a_table() -> None:
    text = b"t,lat_deg,lon_deg\n" + b"".join(b"%.1f,0.0,%.6f\n" % (100 + i / 2, 5 + 1e-5 * i) for i in range(20))
    done = cells(degrade_gnss_csv(text, Faults(latency_s=1.0), SPAN, "run").raw)
    assert done[1] == [b"101.0", b"0.0000000000", b"5.0000000000"]


@pytest.mark.parametrize(("convention", "sign"), [("enu", 1), ("ned", -1)])
def test_positive_drift_turns_the_reading_counter_clockwise(convention: str, sign: int) -> None:
    text = b"t,yaw_deg,gyro_z_dps\n" + b"".join(b"%d,10.00,0.5\n" % (10 * i) for i in range(361))
    new, rows = degrade_ahrs_csv(text, Faults(heading_drift_deg_per_hour=6), convention)  # type: ignore[arg-type]
    assert rows == 360
    yaw = np.array([float(row[1]) for row in cells(new)[1:]])
    np.testing.assert_allclose(yaw, 10 + sign * 6 * np.arange(361) / 360, atol=1e-4)
    assert [[row[0], row[2]] for row in cells(new)] == [[row[0], row[2]] for row in cells(text)]


@pytest.mark.parametrize(
    ("first", "other", "name", "low", "high"),
    [
        (359.99, 181.0, b"yaw_deg", 0, 360),
        (179.99, -170.0, b"yaw_deg", -180, 180),
        (3.1, -3.0, b"yaw_rad", -3.1416, 3.1416),
    ],
)
def test_angles_stay_in_the_range_of_the_file(first: float, other: float, name: bytes, low: float, high: float) -> None:
    text = b"t," + name + b"\n0,%.2f\n3600,%.2f\n7200,%.2f\n" % (first, first, other)
    new, _ = degrade_ahrs_csv(text, Faults(heading_drift_deg_per_hour=5), "enu")
    yaw = np.array([float(row[1]) for row in cells(new)[1:]])
    assert ((yaw >= low) & (yaw <= high)).all()
    turn = 360 if name == b"yaw_deg" else 2 * np.pi
    assert (yaw[1] - first) % turn == pytest.approx(5 * turn / 360, abs=1e-4)


def test_encoder_rows_are_lost_in_bursts_and_as_many_as_asked_for() -> None:
    text = b"t,left_ticks,right_ticks\n" + b"".join(b"%.2f,%d,%d\n" % (i / 100, i, 2 * i) for i in range(5000))
    new, rows = degrade_encoder_csv(text, Faults(encoder_dropout=0.1), "run")
    assert rows == 500
    kept = new.splitlines()
    left = set(kept)
    gone = np.array([line not in left for line in text.splitlines()])
    assert gone.sum() == 500
    assert not gone[[1, -1]].any()
    assert np.count_nonzero(np.diff(gone.astype(int)) == 1) < 350
    assert kept == [line for line, out in zip(text.splitlines(), gone, strict=True) if not out]


def test_missing_columns_are_named() -> None:
    with pytest.raises(DataError, match="header needs t,lat_deg,lon_deg; it has a,b"):
        degrade_gnss_csv(b"a,b\n1,2\n", Faults(), SPAN, "run")
    with pytest.raises(DataError, match="none of 1 rows holds a position"):
        degrade_gnss_csv(b"t,lat_deg,lon_deg\n1,0,0\n", Faults(), SPAN, "run")


@settings(max_examples=100)
@given(
    st.lists(st.one_of(st.integers(0, 9), st.binary(max_size=20)), min_size=1, max_size=30),
    st.sampled_from([b"\n", b"\r\n"]),
    st.booleans(),
)
def test_rows_that_cannot_be_read_survive(rows: list[int | bytes], end: bytes, last_ended: bool) -> None:
    lines = [b"t,lat_deg,lon_deg,fix_quality", b"99,52.5,5.5,4"]
    for i, row in enumerate(rows):
        junk = row.replace(b"\n", b"?").replace(b"\r", b"?").replace(b",", b"?") if isinstance(row, bytes) else b""
        lines.append(b"%d,52.%d,5.25,2" % (100 + i, row) if isinstance(row, int) else junk)
    text = end.join(lines) + (end if last_ended else b"")
    assert degrade_gnss_csv(text, Faults(), SPAN, "run").raw == text
    for faults in (Faults(sigma_m=3), Faults(losses_s=((50.0, 150.0),)), Faults(losses_s=((50.0, 150.0),), drop=True)):
        new = degrade_gnss_csv(text, faults, (0.0, 200.0), "run").raw
        left = [line for line in new.split(end) if line]
        junk_only = [line for line, row in zip(lines[2:], rows, strict=True) if isinstance(row, bytes) and line]
        if faults.drop:
            assert left == [lines[0], *junk_only]
        else:
            assert [
                line for line, row in zip(new.split(end)[2:], rows, strict=False) if isinstance(row, bytes) and line
            ] == junk_only
            assert not any(b",52.%d,5.25," % i in new for i in range(10))
