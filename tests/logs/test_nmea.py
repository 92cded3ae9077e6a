"""NMEA logs: the fast reader against a plain one, and every oddity by itself."""

from __future__ import annotations

import calendar
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sccal.errors import DataError
from sccal.logs.nmea import read_nmea
from sccal.logs.nmea.sentences import parse_decimals
from sccal.logs.streams import FixStream, Notice
from sccal.logs.write import checksum, gga, gst, rmc, zda

NOON_S = float(calendar.timegm((2024, 6, 1, 12, 0, 0)))


def read(folder: Path, lines: list[str] | bytes, end: str = "\n") -> tuple[FixStream, tuple[Notice, ...]]:
    path = folder / "gnss.nmea"
    path.write_bytes(lines if isinstance(lines, bytes) else "".join(line + end for line in lines).encode("latin-1"))
    return read_nmea(path)


def fix(i: int, quality: int = 4, start_s: float = NOON_S) -> str:
    return gga(start_s + 0.1 * i, 52.1 + 1e-6 * i, 5.3 - 2e-6 * i, 40.0 + 0.01 * i, quality, 12, 0.6, 0.8)


def date(i: int, start_s: float = NOON_S) -> str:
    return rmc(start_s + 0.1 * i, 52.1, 5.3, 1.0, 90.0, "R")


def sentence(body: str) -> str:
    return f"${body}*{checksum(body)}"


def found(notices: tuple[Notice, ...], words: str) -> Notice:
    matches = [notice for notice in notices if words in notice.what]
    assert len(matches) == 1, [str(notice) for notice in notices]
    return matches[0]


def test_what_is_written_is_read(tmp_path: Path) -> None:
    lines = []
    for i in range(50):
        lines += [date(i), fix(i), gst(NOON_S + 0.1 * i, 0.012, 0.015 + 0.001 * i)]
    stream, notices = read(tmp_path, [f"{NOON_S + 7 + 0.1 * (k // 3):.4f} {line}" for k, line in enumerate(lines)])
    i = np.arange(50)
    np.testing.assert_allclose(stream.utc_s, NOON_S + 0.1 * i, atol=1e-6)
    np.testing.assert_allclose(stream.host_t_s, NOON_S + 7 + 0.1 * i, atol=1e-6)
    np.testing.assert_allclose(stream.lat_deg, 52.1 + 1e-6 * i, atol=1e-10)
    np.testing.assert_allclose(stream.lon_deg, 5.3 - 2e-6 * i, atol=1e-10)
    np.testing.assert_allclose(stream.alt_m, 40 + 0.01 * i, atol=1e-9)
    np.testing.assert_allclose(stream.sigma_east_m, 0.012)
    np.testing.assert_allclose(stream.sigma_north_m, 0.015 + 0.001 * i)
    np.testing.assert_allclose(stream.cov_en_m2, 0, atol=1e-12)
    np.testing.assert_allclose(stream.extras["age_s"], 0.8)
    np.testing.assert_allclose(stream.extras["hdop"], 0.6)
    np.testing.assert_allclose(stream.extras["satellites"], 12)
    assert (stream.quality == 4).all()
    assert stream.utc_has_date
    assert not notices


@settings(max_examples=60)
@given(st.floats(-90, 90), st.floats(-180, 180), st.floats(0, 4e9))
def test_any_place_and_time_survive(
    tmp_path_factory: pytest.TempPathFactory, lat_deg: float, lon_deg: float, utc_s: float
) -> None:
    lines = [zda(utc_s), gga(utc_s, lat_deg, lon_deg, 1.0, 1, 8, 1.0)]
    stream, _ = read(tmp_path_factory.getbasetemp(), lines)
    assert stream.lat_deg[0] == pytest.approx(lat_deg, abs=2e-10)
    assert stream.lon_deg[0] == pytest.approx(lon_deg, abs=2e-10)
    assert stream.utc_s[0] == pytest.approx(utc_s, abs=0.0051)


@given(st.text("0123456789.-+ eE", max_size=22))
def test_decimals_are_parsed_as_python_does(text: str) -> None:
    data = np.frombuffer(b"," + text.encode() + b"," + bytes(64), dtype=np.uint8)
    got = parse_decimals(data, np.array([1]), np.array([1 + len(text)]))[0]
    plain = text.lstrip("+-") if text[1:].lstrip("+-") == text[1:] else "x"
    if len(text) <= 20 and plain.replace(".", "", 1).isdecimal() and len(plain.partition(".")[0].lstrip("0")) <= 18:
        assert got == pytest.approx(float(text), rel=1e-15)
    elif not (plain.replace(".", "", 1).isdecimal() and len(text) <= 20):
        assert math.isnan(got)


def plain_fixes(lines: list[str]) -> list[tuple[float, float, float, int]]:
    """The oracle: one line at a time, time of day, latitude, longitude and quality of the GGA that can be used."""
    fixes = []
    for line in lines:
        text = line[line.find("$") + 1 :] if "$" in line else ""
        body, star, digits = text.partition("*")
        if not star or checksum(body) != digits.strip().upper():
            continue
        fields = body.split(",")
        if fields[0][2:] != "GGA" or fields[0][0] == "P" or fields[6] == "0":
            continue
        angles = []
        for value, side in ((fields[2], fields[3]), (fields[4], fields[5])):
            degrees, minutes = divmod(float(value), 100)
            angles.append((degrees + minutes / 60) * (-1 if side in "SW" else 1))
        clock = float(fields[1])
        tod_s = clock // 10000 * 3600 + clock % 10000 // 100 * 60 + clock % 100
        fixes.append((tod_s, angles[0], angles[1], int(fields[6])))
    return fixes


@settings(max_examples=40)
@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 255), st.integers(0, 70)), min_size=20, max_size=60))
def test_agrees_with_the_plain_reader(
    tmp_path_factory: pytest.TempPathFactory, faults: list[tuple[int, int, int]]
) -> None:
    lines = []
    for i, (kind, value, place) in enumerate(faults):
        line = fix(i, quality=(0, 1, 2, 4, 5)[i % 5])
        if kind == 1:
            line = line[:place] + chr(value % 26 + 97) + line[place + 1 :]
        elif kind == 2:
            line = sentence("GPGSV,1,1,01,,,,")
        elif kind == 3:
            line = f"{i}.5 {line}"
        lines.append(line)
    expected = plain_fixes(lines)
    if not expected:
        return
    stream, _ = read(tmp_path_factory.getbasetemp(), lines)
    got = np.column_stack((stream.utc_s, stream.lat_deg, stream.lon_deg, stream.quality))
    np.testing.assert_allclose(got, np.array(expected), atol=1e-9)


def test_wrong_checksums_are_dropped_and_counted(tmp_path: Path) -> None:
    lines = [date(0), *(fix(i) for i in range(20))]
    lines[5] = lines[5].replace("52", "53", 1).replace("5206", "5306", 1)
    stream, notices = read(tmp_path, lines)
    notice = found(notices, "wrong checksum")
    assert (notice.count, notice.where) == (1, "line 6")
    assert stream.lat_deg.size == 19
    assert stream.lat_deg.max() < 52.2


def test_sentences_without_checksum_are_read_and_told(tmp_path: Path) -> None:
    lines = [date(0), *(fix(i).partition("*")[0] for i in range(10)), "$GNGGA,120001.00,5206.1"]
    stream, notices = read(tmp_path, lines)
    assert stream.lat_deg.size == 10
    assert found(notices, "without checksum").count == 10
    assert found(notices, "missing fields").where == "line 12"


@pytest.mark.parametrize("cut", [1, 4, 20, 60])
def test_a_cut_last_line_is_counted(tmp_path: Path, cut: int) -> None:
    text = "\n".join([date(0), *(fix(i) for i in range(10))])
    stream, notices = read(tmp_path, text[:-cut].encode())
    assert stream.lat_deg.size == 9
    assert found(notices, "cut").where == "line 11"


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", "\r\r\n"])
@pytest.mark.parametrize("prefix", ["12.5 ", "12.5,", "12.5\t", "12.5, "])
def test_line_ends_and_prefixes(tmp_path: Path, end: str, prefix: str) -> None:
    stream, notices = read(tmp_path, [prefix + line for line in (date(0), fix(0), fix(1))], end)
    assert stream.host_t_s.tolist() == [12.5, 12.5]
    assert not notices


def test_binary_between_sentences_is_passed_over(tmp_path: Path) -> None:
    junk = bytes(range(256)) * 3 + b"\xd3\x00\x13$*,$GN"
    data = b"".join(junk + line.encode() + b"\r\n" for line in (date(0), fix(0), fix(1), fix(2)))
    stream, _ = read(tmp_path, data)
    assert stream.lat_deg.size == 3
    assert stream.utc_has_date


def test_sentences_on_one_line_share_its_time(tmp_path: Path) -> None:
    stream, _ = read(tmp_path, ["5.5 " + date(0) + fix(0), "5.6 " + fix(1) + fix(2)])
    assert stream.host_t_s.tolist() == [5.5, 5.6, 5.6]


@pytest.mark.parametrize("talker", ["GP", "GN", "GL", "GA", "GB", "BD", "GQ", "GI", "gn"])
def test_talkers(tmp_path: Path, talker: str) -> None:
    lines = [sentence(talker + fix(i)[3:].partition("*")[0]) for i in range(3)]
    stream, _ = read(tmp_path, lines)
    assert stream.lat_deg.size == 3


def test_proprietary_and_other_sentences_are_counted(tmp_path: Path) -> None:
    other = [sentence("PUBX,00,1"), sentence("GPGSV,1,1,01"), sentence("PTGGA,120000.00,1,N,2,E,4,,,,,,,,")]
    stream, notices = read(tmp_path, [*other, date(0), fix(0), fix(1)])
    assert stream.lat_deg.size == 2
    assert found(notices, "other sentences").count == 3


def test_no_fix_is_counted_and_not_a_fix(tmp_path: Path) -> None:
    blank = sentence("GNGGA,120000.50,,,,,4,00,,,,,,,")
    stream, notices = read(tmp_path, [date(0), fix(0), fix(1, quality=0), fix(2), blank])
    assert stream.lat_deg.size == 2
    assert found(notices, "without a fix").count == 1
    assert found(notices, "empty position").count == 1


@pytest.mark.parametrize("place", ["5260.1,N,00518,E", "9100,N,00518,E", "5206,X,00518,E", "5206,N,18100,E", "x,N,1,E"])
def test_impossible_positions_are_dropped(tmp_path: Path, place: str) -> None:
    bad = sentence(f"GNGGA,120000.50,{place},4,12,0.6,40,M,0,M,,")
    stream, notices = read(tmp_path, [date(0), fix(0), bad, fix(6)])
    assert stream.lat_deg.size == 2
    assert found(notices, "impossible").where == "line 3"


@pytest.mark.parametrize("dating", [rmc(NOON_S, 1, 1, 1, 1), zda(NOON_S)])
def test_a_date_reaches_back_and_on(tmp_path: Path, dating: str) -> None:
    stream, _ = read(tmp_path, [fix(0), fix(1), dating, fix(2), fix(3)])
    np.testing.assert_allclose(stream.utc_s, NOON_S + 0.1 * np.arange(4), atol=1e-6)
    assert stream.utc_has_date


@pytest.mark.parametrize("dated_at", [None, 0, 50, 99])
def test_midnight(tmp_path: Path, dated_at: int | None) -> None:
    start_s = float(calendar.timegm((2023, 12, 31, 23, 59, 55)))
    lines = [fix(i, start_s=start_s) for i in range(100)]
    if dated_at is not None:
        lines.insert(dated_at, date(dated_at, start_s=start_s))
    stream, notices = read(tmp_path, lines)
    np.testing.assert_allclose(np.diff(stream.utc_s), 0.1, atol=1e-6)
    assert stream.utc_has_date == (dated_at is not None)
    if dated_at is not None:
        assert stream.utc_s[0] == pytest.approx(start_s)
    assert not notices


@pytest.mark.parametrize(("year", "expected"), [("80", 1980), ("99", 1999), ("00", 2000), ("24", 2024), ("79", 2079)])
def test_years_of_two_digits(tmp_path: Path, year: str, expected: int) -> None:
    dating = sentence(f"GNRMC,120000.00,A,5206,N,00518,E,,,0106{year},,,A")
    stream, _ = read(tmp_path, [dating, fix(0), fix(1)])
    assert stream.utc_s[0] == calendar.timegm((expected, 6, 1, 12, 0, 0))


def test_a_date_that_jumps_for_a_few_lines_is_ignored(tmp_path: Path) -> None:
    lines = []
    for i in range(100):
        wrong = sentence(f"GNRMC,12000{0.1 * i:.2f},A,5206,N,00518,E,,,181038,,,A")
        lines += [wrong if i in (40, 41) else date(i), fix(i)]
    stream, notices = read(tmp_path, lines)
    np.testing.assert_allclose(stream.utc_s, NOON_S + 0.1 * np.arange(100), atol=1e-6)
    assert "2038-10-18" in found(notices, "contradict").what


def test_impossible_dates_are_no_dates(tmp_path: Path) -> None:
    lines = [sentence(f"GNRMC,120000.00,A,5206,N,00518,E,,,{d},,,A") for d in ("310224", "000000", "011324", "x")]
    stream, _ = read(tmp_path, [*lines, fix(0), fix(1)])
    assert not stream.utc_has_date
    assert stream.utc_s[0] == pytest.approx(12 * 3600)


def test_two_talkers_at_one_epoch_keep_the_first(tmp_path: Path) -> None:
    lines = [date(0)]
    for i in range(10):
        lines += [fix(i), sentence("GP" + fix(i, quality=1)[3:].partition("*")[0])]
    stream, notices = read(tmp_path, lines)
    assert stream.quality.tolist() == [4] * 10
    assert found(notices, "seen before").count == 10


def test_epochs_out_of_order_are_sorted(tmp_path: Path) -> None:
    stream, notices = read(tmp_path, [date(0), fix(0), fix(2), fix(1), fix(3)])
    assert (np.diff(stream.utc_s) > 0).all()
    assert found(notices, "out of order").count == 1


def test_sigmas_belong_to_their_epoch_and_the_ellipse_gives_the_covariance(tmp_path: Path) -> None:
    major, minor, bearing = 0.05, 0.02, math.radians(30)
    north = math.hypot(major * math.cos(bearing), minor * math.sin(bearing))
    east = math.hypot(major * math.sin(bearing), minor * math.cos(bearing))
    cov = (major**2 - minor**2) * math.sin(bearing) * math.cos(bearing)
    ellipse = sentence(f"GNGST,120000.10,,{major},{minor},30.0,{north:.6f},{east:.6f},0.1")
    wrong = sentence("GNGST,120000.20,,0.9,0.1,30.0,0.010,0.011,0.1")
    zero = sentence("GNGST,120000.30,,,,,0.000,0.000,0.000")
    stream, _ = read(tmp_path, [date(0), *(fix(i) for i in range(5)), ellipse, wrong, zero])
    np.testing.assert_allclose(stream.sigma_north_m, [np.nan, north, 0.010, np.nan, np.nan], atol=1e-6)
    np.testing.assert_allclose(stream.sigma_east_m, [np.nan, east, 0.011, np.nan, np.nan], atol=1e-6)
    np.testing.assert_allclose(stream.cov_en_m2, [0, cov, 0, 0, 0], rtol=1e-3)


def test_height_above_the_ellipsoid_needs_the_separation(tmp_path: Path) -> None:
    both = sentence("GNGGA,120000.00,5206,N,00518,E,4,12,0.6,40.5,M,44.5,M,,")
    only = sentence("GNGGA,120000.10,5206,N,00518,E,4,12,0.6,40.5,M,,M,,")
    none = sentence("GNGGA,120000.20,5206,N,00518,E,4,12,0.6,,M,,M,,")
    stream, _ = read(tmp_path, [date(0), both, only, none])
    np.testing.assert_allclose(stream.alt_m, [85.0, 40.5, np.nan])


@pytest.mark.parametrize(("mode", "quality"), [("R", 4), ("F", 5), ("D", 2), ("A", 1), ("E", 6)])
def test_rmc_stands_in_where_there_is_no_gga(tmp_path: Path, mode: str, quality: int) -> None:
    lines = [rmc(NOON_S + i, 52.1, 5.3, 1.0, 90.0, mode) for i in range(5)]
    lines.append(rmc(NOON_S + 5, 52.1, 5.3, 1.0, 90.0, "N"))
    stream, notices = read(tmp_path, lines)
    assert stream.quality.tolist() == [quality] * 5
    np.testing.assert_allclose(stream.lat_deg, 52.1)
    assert found(notices, "there is no GGA").severity == "warning"


def test_rmc_of_the_old_standard_has_no_quality(tmp_path: Path) -> None:
    lines = [sentence(f"GPRMC,12000{i}.00,A,5206,N,00518,E,1,2,010624,,") for i in range(3)]
    stream, _ = read(tmp_path, lines)
    assert stream.quality.tolist() == [-1, -1, -1]


@pytest.mark.parametrize("data", [b"", b"nothing here\n", b"$GPGSV,1*00\n", fix(0, quality=0).encode() + b"\n"])
def test_no_fix_at_all_is_an_error(tmp_path: Path, data: bytes) -> None:
    with pytest.raises(DataError, match=r"gnss\.nmea"):
        read(tmp_path, data)


def test_some_receive_times_missing_are_told(tmp_path: Path) -> None:
    stream, notices = read(tmp_path, [date(0), "1.0 " + fix(0), fix(1), "1.2 " + fix(2)])
    assert np.isnan(stream.host_t_s[1])
    assert found(notices, "without a receive time").count == 1


def test_long_messages_alone_are_named(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="#RANGEA, a long message"):
        read(
            tmp_path,
            b"1717243200.5 #RANGEA,COM1,0,72.0,FINESTEERING,2316,561618.000;SOL_COMPUTED,NARROW_INT*00000000\n",
        )
