"""Numbers that no log can mean are refused or told with their line, and files that are no logs end in one line."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys
import time
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fuzz.readers import READERS, check_fixes, check_heading, check_wheels, feed
from fuzz.seeds import run_files, with_checksum
from sccal.align import align
from sccal.cli import main
from sccal.errors import DataError, SccalError, one_line
from sccal.logs.ahrs import read_ahrs
from sccal.logs.encoder import read_encoder
from sccal.logs.first_look import require_any_log
from sccal.logs.gnss_csv import read_gnss_csv
from sccal.logs.nmea import read_nmea
from sccal.logs.run import discover, read_run
from sccal.logs.streams import Notice, Vehicle
from sccal.logs.vehicle import read_vehicle

ROWS = 40
VEHICLE = Vehicle("robot", Path("vehicle.toml"), 0.08, 0.7, 1000.0)
quick = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
rows = st.integers(0, ROWS - 1)
no_number = st.sampled_from(["nan", "inf", "-inf", "", "x", "1e999", "--1", "0x10", "1.2.3"])


def sheet(header: str, cell: Callable[[int], str], row: int, column: int, value: str) -> str:
    """A table of ROWS good rows, of which one cell says ``value``."""
    lines = [header]
    for i in range(ROWS):
        cells = cell(i).split(",")
        if i == row:
            cells[column] = value
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def encoder(path: Path, row: int, column: int, value: str) -> Path:
    path.write_text(
        sheet("t,left_ticks,right_ticks", lambda i: f"{0.05 * i:.2f},{20 * i},{21 * i}", row, column, value)
    )
    return path


def ahrs(path: Path, row: int, column: int, value: str) -> Path:
    header = "t,yaw_deg,pitch_deg,roll_deg,yaw_sigma_deg"
    path.write_text(sheet(header, lambda i: f"{0.05 * i:.2f},{i},1,2,0.5", row, column, value))
    return path


def gnss(path: Path, row: int, column: int, value: str) -> Path:
    header = "t,lat_deg,lon_deg,alt_m,fix_quality,sigma_m"
    path.write_text(sheet(header, lambda i: f"{0.2 * i:.2f},47.{i:05},8.5,400,4,0.02", row, column, value))
    return path


def nmea(path: Path, row: int, field: int, value: str) -> Path:
    """GGA of which one field of one sentence says ``value``."""
    lines = []
    for i in range(ROWS):
        fields = f"$GNGGA,1200{i:02}.00,4717.{1000 + i},N,00833.1000,E,4,12,0.8,408.0,M,47.0,M,1.0,0000".split(",")
        if i == row:
            fields[field] = value
        lines.append(b"%d.0 " % (1717243200 + i) + with_checksum(",".join(fields).encode()))
    path.write_bytes(b"\n".join(lines) + b"\n")
    return path


def told(notices: tuple[Notice, ...], line: int) -> bool:
    return any(notice.where == f"line {line}" and notice.count >= 1 for notice in notices)


@quick
@given(row=rows, side=st.sampled_from([1, 2]), value=st.one_of(no_number, st.sampled_from(["1e300", "-1e19", "1e20"])))
def test_counts_that_no_counter_holds_are_dropped_with_their_line(tmp_path, row, side, value):
    stream, notices = read_encoder(encoder(tmp_path / "encoder.csv", row, side, value), VEHICLE)
    check_wheels(stream)
    assert told(notices, row + 2)
    assert stream.t_s.size == ROWS - 1
    assert np.ptp(stream.left_rad) <= 20 * ROWS / 1000 * 2 * np.pi


@quick
@given(offset=st.integers(2**53 + 1, 2**63 - 10**6), sign=st.sampled_from([1, -1]))
def test_ticks_beyond_the_precision_of_a_float_are_told(tmp_path, offset, sign):
    path = tmp_path / "encoder.csv"
    lines = (f"{0.05 * i:.2f},{sign * (offset + 20 * i)},{i}\n" for i in range(ROWS))
    path.write_text("t,left_ticks,right_ticks\n" + "".join(lines))
    line = ""
    try:
        _, notices = read_encoder(path, VEHICLE)
    except DataError as error:
        line = str(error)
    else:
        line = next(str(notice) for notice in notices if "2^53" in notice.what)
    assert "encoder.csv" in line
    assert "line 2)" in line


@pytest.mark.parametrize("value", ["1e300", "-1e300", "1e19", "9" * 400])
def test_a_whole_column_of_impossible_counts_is_refused(tmp_path, value):
    path = tmp_path / "encoder.csv"
    path.write_text("t,left_ticks,right_ticks\n" + "".join(f"{0.05 * i:.2f},{value},{i}\n" for i in range(ROWS)))
    with pytest.raises(DataError, match=r"line 2\b"):
        read_encoder(path, VEHICLE)


WHOLE_COMMANDS = {"cli", "align", "rewritten", "mcap_rewritten"}
TABLES = {"encoder": encoder, "ahrs": ahrs, "gnss": gnss}


def streamed(name: str, path: Path) -> tuple[np.ndarray, tuple[Notice, ...]]:
    """Times and notices of one reader."""
    if name == "encoder":
        wheels, notices = read_encoder(path, VEHICLE)
        check_wheels(wheels)
        return wheels.t_s, notices
    if name == "ahrs":
        heading, notices = read_ahrs(path)
        check_heading(heading)
        return heading.t_s, notices
    fixes, notices = read_gnss_csv(path)
    check_fixes(fixes)
    return fixes.host_t_s, notices


@quick
@given(
    name=st.sampled_from(sorted(TABLES)),
    row=st.integers(2, ROWS - 3),
    value=st.one_of(no_number, st.sampled_from(["1e300", "-1e300", "1e12", "-1e12", "1717243200000", "-5e5"])),
)
def test_impossible_times_are_dropped_with_their_line(tmp_path, name, row, value):
    t_s, notices = streamed(name, TABLES[name](tmp_path / f"{name}.csv", row, 0, value))
    assert told(notices, row + 2)
    assert t_s.size == ROWS - 1
    assert 0 <= t_s.min() < t_s.max() <= 0.2 * ROWS


@pytest.mark.parametrize("name", sorted(TABLES))
@pytest.mark.parametrize("scale", [1e3, 1e6, 1e9])
def test_times_whose_size_leaves_no_doubt_of_their_unit_are_read_and_told(tmp_path, name, scale):
    path = tmp_path / f"{name}.csv"
    header, *lines = TABLES[name](path, 0, 0, "0").read_text().splitlines()
    for i, line in enumerate(lines):
        lines[i] = f"{(1717243200 + 0.05 * i) * scale:.0f},{line.partition(',')[2]}"
    path.write_text("\n".join([header, *lines]) + "\n")
    t_s, notices = streamed(name, path)
    assert t_s - 1717243200 == pytest.approx(0.05 * np.arange(len(lines)), abs=1e-3)
    assert any("seconds since 1970" in str(notice) for notice in notices)


@pytest.mark.parametrize("name", sorted(TABLES))
def test_negative_times_are_times_and_decreasing_ones_are_refused(tmp_path, name):
    path = tmp_path / f"{name}.csv"
    header, *lines = TABLES[name](path, 0, 0, "0").read_text().splitlines()
    for sign in (1, -1):
        own = [f"{-1e6 + 5 * sign * i},{line.partition(',')[2]}" for i, line in enumerate(lines)]
        path.write_text("\n".join([header, *own]) + "\n")
        if sign == 1:
            assert streamed(name, path)[0][0] == -1e6
        else:
            with pytest.raises(DataError, match="line 3"):
                streamed(name, path)


@quick
@given(
    row=rows,
    place=st.sampled_from([(1, "91"), (1, "-90.0001"), (1, "1e300"), (2, "1e9"), (2, "-361"), (2, "1e300")])
    | st.tuples(st.sampled_from([1, 2]), no_number),
)
def test_places_outside_of_the_earth_are_dropped_with_their_line(tmp_path, row, place):
    stream, notices = read_gnss_csv(gnss(tmp_path / "gnss.csv", row, *place))
    check_fixes(stream)
    assert told(notices, row + 2)
    assert stream.lat_deg.size == ROWS - 1


@quick
@given(
    row=rows,
    place=st.sampled_from([(3, "1e300"), (3, "-2e5"), (5, "1e300"), (5, "-1"), (5, "0"), (4, "77"), (4, "1e300")]),
)
def test_what_goes_with_a_fix_stays_in_its_range(tmp_path, row, place):
    stream, _ = read_gnss_csv(gnss(tmp_path / "gnss.csv", row, *place))
    check_fixes(stream)
    assert stream.lat_deg.size == ROWS


@quick
@given(
    row=rows,
    place=st.sampled_from(
        [
            *((2, latitude) for latitude in ("9100.0000", "9000.0001", "4760.0000", "4799.9999", "-4717.1", "nan")),
            *((4, longitude) for longitude in ("18000.1", "00860.0000", "99999.0", "1e3", "9" * 30)),
            (3, "E"),
            (5, "N"),
        ]
    ),
)
def test_sentences_with_impossible_places_are_dropped_with_their_line(tmp_path, row, place):
    stream, notices = read_nmea(nmea(tmp_path / "gnss.nmea", row, *place))
    check_fixes(stream)
    assert told(notices, row + 1)
    assert stream.lat_deg.size == ROWS - 1


@quick
@given(row=rows, value=st.sampled_from(["240000.00", "126000.00", "-120000.00", "nan", "9" * 25, "120061.00", ""]))
def test_sentences_with_impossible_times_give_no_fix(tmp_path, row, value):
    stream, _ = read_nmea(nmea(tmp_path / "gnss.nmea", row, 1, value))
    check_fixes(stream)
    assert stream.lat_deg.size == ROWS - 1


@quick
@given(row=rows, value=st.one_of(no_number, st.sampled_from(["1e300", "-1e10"])))
def test_yaws_that_mean_nothing_are_dropped_with_their_line(tmp_path, row, value):
    stream, notices = read_ahrs(ahrs(tmp_path / "ahrs.csv", row, 1, value))
    check_heading(stream)
    assert told(notices, row + 2)
    assert stream.t_s.size == ROWS - 1


@quick
@given(row=rows, column=st.sampled_from([2, 3, 4]), value=st.sampled_from(["1e300", "-1e300", "1e5", "inf"]))
def test_impossible_tilts_and_sigmas_are_taken_as_empty_with_their_line(tmp_path, row, column, value):
    stream, notices = read_ahrs(ahrs(tmp_path / "ahrs.csv", row, column, value))
    check_heading(stream)
    assert told(notices, row + 2)
    assert stream.t_s.size == ROWS


@quick
@given(
    key=st.sampled_from(["wheel_radius_m", "track_m", "ticks_per_rev"]),
    value=st.sampled_from(["0", "-1", "nan", "inf", "-inf", "1e300", "1e-300", "true", '"1"', "[1]", str(10**400)]),
)
def test_sizes_of_no_vehicle_are_refused_by_name(tmp_path, key, value):
    values = {"wheel_radius_m": "0.08", "track_m": "0.7", "ticks_per_rev": "1000", key: value}
    path = tmp_path / "vehicle.toml"
    nominal = f"[nominal]\nwheel_radius_m = {values['wheel_radius_m']}\ntrack_m = {values['track_m']}\n"
    path.write_text(f"{nominal}[encoder]\nticks_per_rev = {values['ticks_per_rev']}\n")
    with pytest.raises(DataError, match=rf"\[\w+\] {key}"):
        read_vehicle(path)


@quick
@given(
    name=st.sampled_from(sorted(set(READERS) - {"cli", "align", "rewritten", "mcap_rewritten"})),
    data=st.binary(max_size=400),
)
def test_any_bytes_end_in_a_stream_or_in_one_line(tmp_path, name, data):
    assert feed(READERS[name], data, tmp_path)


@given(st.text())
def test_messages_are_one_printable_line(text):
    for line in (str(SccalError(text)), str(Notice("a", text, 1)), one_line(text)):
        assert line.isprintable()
        assert len(line) <= 3000


def sccal(folder: Path, out: Path) -> tuple[int, str, float]:
    """Exit code, stderr and processor seconds of ``sccal calibrate``, in this process."""
    shown, err = io.StringIO(), io.StringIO()
    begin = time.process_time()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(shown), contextlib.redirect_stderr(err):
        patch.setattr(sys, "argv", ["sccal", "calibrate", str(folder), "--out", str(out)])
        with pytest.raises(SystemExit) as caught:
            main()
    return int(caught.value.code or 0), err.getvalue(), time.process_time() - begin


def png() -> bytes:
    body = b"IHDR" + bytes((0, 0, 0, 1, 0, 0, 0, 1, 8, 0, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + b"\0\0\0\x0d" + body + zlib.crc32(body).to_bytes(4, "big")


def junk(path: Path) -> bytes:
    return np.random.default_rng(len(path.name)).integers(0, 256, 100_000, dtype=np.uint8).tobytes()


def million_columns(_: Path) -> bytes:
    return b",".join(b"c%d" % i for i in range(10**6)) + b"\n" + b",".join([b"1"] * 10**6) + b"\n"


def endless_line(path: Path) -> bytes:
    first = run_files()[path.name].split(b"\n")[0] if path.name in run_files() else b"\x89MCAP0\r"
    return first + b"\n" + b"1" * 50_000_000


def refuse_to_open(path: Path) -> None:
    """A pipe without a writer: whoever opens it waits for ever."""
    os.mkfifo(path)


CONTENTS: dict[str, Callable[[Path], bytes]] = {
    "zeros": lambda _: bytes(10**6),
    "png": lambda _: png(),
    "million_columns": million_columns,
    "endless_line": endless_line,
    "junk": junk,
    "empty": lambda _: b"",
}
NO_FILES: dict[str, Callable[[Path], None]] = {
    "folder": Path.mkdir,
    "pipe": refuse_to_open,
    "device": lambda path: path.symlink_to("/dev/zero"),
    "loop": lambda path: path.symlink_to(path.name),
    "dangling": lambda path: path.symlink_to("nowhere"),
}
FILES = ("encoder.csv", "ahrs.csv", "gnss.nmea", "gnss.csv", "vehicle.toml", "log.mcap", "log.db3", "log.bag")


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("what", [*CONTENTS, *NO_FILES])
def test_what_is_no_log_ends_in_one_line(tmp_path, name, what):
    folder = tmp_path / "run"
    folder.mkdir()
    alone = name.startswith("log.")
    fixes = "gnss.csv" if name == "gnss.csv" else "gnss.nmea"
    for one in ("vehicle.toml",) if alone else ("encoder.csv", "ahrs.csv", "vehicle.toml", fixes):
        (folder / one).write_bytes(run_files()[one])
    path = folder / name
    path.unlink(missing_ok=True)
    if what in CONTENTS:
        path.write_bytes(CONTENTS[what](path))
    else:
        NO_FILES[what](path)
    code, err, _ = sccal(folder, tmp_path / "out")
    assert code == 3
    assert err.startswith("sccal: ")
    assert len(err.splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("sparse", ["encoder.csv", "gnss.csv"])
def test_few_rows_over_many_days_take_no_grid_over_all_of_them(tmp_path, sparse):
    (tmp_path / "vehicle.toml").write_bytes(run_files()["vehicle.toml"])
    for name, cells in (
        ("encoder.csv", "left_ticks,right_ticks"),
        ("ahrs.csv", "yaw_deg"),
        ("gnss.csv", "lat_deg,lon_deg"),
    ):
        step_s = 80_000.0 if name == sparse else 0.1
        values = [
            f"{47 + 1e-6 * i:.6f},8" if name == "gnss.csv" else f"{i}" + ",1" * ("," in cells) for i in range(400)
        ]
        rows = (f"{step_s * i:.1f},{value}\n" for i, value in enumerate(values))
        (tmp_path / name).write_text(f"t,{cells}\n" + "".join(rows))
    (source,) = discover([tmp_path])
    with pytest.raises(DataError, match="one in"):
        align(read_run(source))


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="nothing is closed to root")
def test_a_file_without_permission_ends_in_one_line(tmp_path):
    for name in ("encoder.csv", "ahrs.csv", "gnss.nmea", "vehicle.toml"):
        (tmp_path / name).write_bytes(run_files()[name])
    (tmp_path / "ahrs.csv").chmod(0)
    code, err, _ = sccal(tmp_path, tmp_path / "out")
    assert (code, len(err.splitlines())) == (3, 1)
    assert "ahrs.csv" in err


@pytest.mark.parametrize("path", ["/dev/zero", "/dev/null"])
def test_a_device_is_not_opened(path, tmp_path):
    code, err, _ = sccal(Path(path), tmp_path / "out")
    assert (code, len(err.splitlines())) == (3, 1)


def test_a_bag_folder_with_a_pipe_is_not_opened(tmp_path):
    (tmp_path / "vehicle.toml").write_bytes(run_files()["vehicle.toml"])
    os.mkfifo(tmp_path / "metadata.yaml")
    os.mkfifo(tmp_path / "a.db3")
    code, err, _ = sccal(tmp_path, tmp_path / "out")
    assert (code, len(err.splitlines())) == (3, 1)
    assert "not a regular file" in err


def test_folders_that_hold_themselves_are_walked_once(tmp_path):
    (tmp_path / "self").symlink_to(tmp_path)
    code, err, _ = sccal(tmp_path, tmp_path / "out")
    assert (code, len(err.splitlines())) == (3, 1)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("log.mcap", bytes(100_000)),
        ("log.mcap", b"\x89PNG\r\n\x1a\n" + bytes(1000)),
        ("encoder.csv", b",".join(b"c%d" % i for i in range(1_000_000)) + b"\n"),
        ("gnss.csv", b",".join(b"c%d" % i for i in range(2000)) + b"\n1,2\n"),
        ("ahrs.csv", bytes(5_000_000)),
        ("ahrs.csv", b"# a comment\n" * 10 + b"," * 70_000),
    ],
    ids=["zeros", "picture", "million columns", "many columns", "zeros in a table", "endless line"],
)
def test_what_cannot_be_a_log_is_refused_before_anything_heavy_is_loaded(tmp_path, name, content):
    for one in ("encoder.csv", "ahrs.csv", "gnss.nmea", "vehicle.toml"):
        (tmp_path / one).write_bytes(run_files()[one])
    (tmp_path / name).write_bytes(content)
    path = tmp_path / name if name == "log.mcap" else tmp_path
    script = (
        f"import sys\nsys.argv = ['sccal', 'calibrate', {str(path)!r}, '--out', {str(tmp_path / 'out')!r}]\n"
        "from sccal.cli import main\n"
        "try:\n    main()\nexcept SystemExit as end:\n    print(end.code)\n"
        "print([name for name in ('pandas', 'numba', 'scipy', 'matplotlib') if name in sys.modules])"
    )
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert found.stdout.split("\n")[:2] == ["3", "[]"]
    assert len(found.stderr.splitlines()) == 1
    assert name in found.stderr


def test_a_header_after_a_megabyte_of_comments_is_found(tmp_path):
    path = tmp_path / "ahrs.csv"
    path.write_bytes(b"# nothing\n" * 200_000 + b"t,yaw_deg\n" + b"".join(b"%d,1\n" % i for i in range(50)))
    require_any_log([tmp_path])
    assert read_ahrs(path)[0].t_s.size == 50
