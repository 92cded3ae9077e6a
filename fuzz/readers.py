"""What is fuzzed: each reader, fed with bytes, and what must hold of whatever it answers.

An answer is a stream whose numbers lie in their ranges, or an SccalError of one line that names the file and a place
in it. Anything else raises: a foreign exception, Broken for a promise not kept, or Stuck for too much time.
"""

from __future__ import annotations

import contextlib
import io
import re
import shutil
import signal
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from fuzz.seeds import run_files
from sccal.align import Aligned, align
from sccal.errors import DataError, SccalError
from sccal.logs.ahrs import read_ahrs
from sccal.logs.encoder import read_encoder
from sccal.logs.gnss_csv import read_gnss_csv
from sccal.logs.messages.read import read_message_log
from sccal.logs.nmea import read_nmea, read_nmea_heading
from sccal.logs.options import ReadOptions
from sccal.logs.reference import MANIFEST_FILE, read_reference, read_reference_rows
from sccal.logs.run import discover, read_run
from sccal.logs.streams import FixStream, HeadingStream, Notice, Vehicle, WheelStream
from sccal.logs.vehicle import read_vehicle

PLACE = re.compile(r"line \d|byte \d|message \d|\d+ bytes|row \d|\bt = |\[\w+\]")
"""A place in a file, in the words of the messages."""
WHOLE_FILE = re.compile(
    r"lacks |cannot be read as a ROS|UTF-16|no message can be read|no topic|no joint|topics may be|share no time"
)
"""Failures that concern a file as a whole."""
TIME_LIMIT_S = 1e11
HEIGHT_LIMIT_M = 1e6
SIGMA_LIMIT_M = 1e6
LONGEST_LINE = 4000


class Broken(AssertionError):  # noqa: N818
    """A promise of the readers that was not kept."""


class Stuck(BaseException):
    """More processor time than an input of this size may take; no `except Exception` stops it."""


@dataclass(frozen=True)
class Reader:
    """One reader as a target."""

    name: str
    file: str
    """The name that the bytes get on disk."""
    feed: Callable[[Path], str]
    """Reads the file of that name; gives what came out, in a word."""
    text: bool = True
    limit_s: float = 5.0
    """Processor time for one input."""


def _require(holds: object, what: str) -> None:
    if not holds:
        raise Broken(what)


def _check_times(t_s: np.ndarray, what: str) -> None:
    _require(np.isfinite(t_s).all(), f"{what}: times that are not finite")
    _require((np.diff(t_s) > 0).all(), f"{what}: times that do not increase")
    _require((np.abs(t_s) <= TIME_LIMIT_S).all(), f"{what}: times out of range")


def _check_notices(notices: tuple[Notice, ...]) -> None:
    for notice in notices:
        _require(notice.count >= 0, f"a count below zero: {notice}")
        _require("\n" not in str(notice) and len(str(notice)) <= LONGEST_LINE, "a notice of several lines or endless")


def check_wheels(stream: WheelStream) -> None:
    """Raise Broken where wheels hold what no wheel can."""
    _check_times(stream.t_s, "wheels")
    for angle in (stream.left_rad, stream.right_rad):
        _require(angle.shape == stream.t_s.shape and np.isfinite(angle).all(), "wheels: angles that are not finite")
    _require(stream.loose.shape == stream.t_s.shape, "wheels: loose has another length")
    for name, column in stream.extras.items():
        _require(column.shape == stream.t_s.shape, f"wheels: {name} has another length")
        _require(not np.isinf(column).any(), f"wheels: {name} is infinite")


def check_heading(stream: HeadingStream) -> None:
    """Raise Broken where a heading holds what no instrument can mean."""
    _check_times(stream.t_s, "heading")
    _require(np.isfinite(stream.yaw_rad).all(), "heading: yaws that are not finite")
    _require((np.abs(stream.yaw_rad) <= 1e9).all(), "heading: yaws out of range")
    for name in ("pitch_rad", "roll_rad"):
        angle = getattr(stream, name)
        if angle is not None:
            _require(angle.shape == stream.t_s.shape, f"heading: {name} has another length")
            _require(not (np.abs(angle) > 2 * np.pi + 1e-9).any(), f"heading: {name} out of range")
    if stream.yaw_sigma_rad is not None:
        _require(not (stream.yaw_sigma_rad <= 0).any(), "heading: sigmas of zero or less")
        _require(not np.isinf(stream.yaw_sigma_rad**2).any(), "heading: sigmas without bound")


def check_fixes(stream: FixStream) -> None:
    """Raise Broken where fixes hold what no receiver can mean."""
    n = stream.lat_deg.size
    _require((np.abs(stream.lat_deg) <= 90).all(), "fixes: latitudes beyond 90")
    _require((np.abs(stream.lon_deg) <= 180).all(), "fixes: longitudes beyond 180")
    _require((np.abs(stream.host_t_s[np.isfinite(stream.host_t_s)]) <= TIME_LIMIT_S).all(), "fixes: times out of range")
    _require(not np.isinf(stream.host_t_s).any(), "fixes: infinite times")
    if np.isfinite(stream.utc_s).all():
        _check_times(stream.utc_s, "fixes (utc)")
    elif np.isfinite(stream.host_t_s).all():
        _check_times(stream.host_t_s, "fixes")
    _require(((stream.quality >= -1) & (stream.quality <= 9)).all(), "fixes: qualities out of range")
    _require(not (np.abs(stream.alt_m) > HEIGHT_LIMIT_M).any(), "fixes: heights out of range")
    for sigma in (stream.sigma_east_m, stream.sigma_north_m):
        _require(not (sigma <= 0).any() and not (sigma > SIGMA_LIMIT_M).any(), "fixes: sigmas out of range")
    _require(np.isfinite(stream.cov_en_m2).all(), "fixes: covariances that are not finite")
    stated = np.isfinite(stream.sigma_east_m + stream.sigma_north_m)
    bound = (stream.sigma_east_m * stream.sigma_north_m)[stated]
    _require((np.abs(stream.cov_en_m2[stated]) <= bound * (1 + 1e-9)).all(), "fixes: impossible covariances")
    if stream.speed_mps is not None:
        _require(not (stream.speed_mps < 0).any(), "fixes: negative speeds")
        _require(not (stream.speed_mps > 1e4).any(), "fixes: speeds out of range")
    for name, column in stream.extras.items():
        _require(column.shape == (n,) and not np.isinf(column).any(), f"fixes: {name} is infinite or of another length")


def check_aligned(aligned: Aligned) -> None:
    """Raise Broken where an aligned run could not be filtered."""
    for name in ("wheel_t_s", "heading_t_s", "fix_t_s"):
        _check_times(getattr(aligned, name), name)
    for name in (
        "right_rad",
        "left_rad",
        "yaw_rad",
        "fix_east_m",
        "fix_north_m",
        "fix_var_east_m2",
        "fix_var_north_m2",
    ):
        _require(np.isfinite(getattr(aligned, name)).all(), f"aligned: {name} is not finite")
    _require((aligned.fix_var_east_m2 > 0).all() and (aligned.fix_var_north_m2 > 0).all(), "aligned: variances of zero")
    cov2 = aligned.fix_cov_m2**2
    _require((cov2 <= aligned.fix_var_east_m2 * aligned.fix_var_north_m2 * (1 + 1e-9)).all(), "aligned: covariances")


def check_error(error: SccalError, file: str) -> None:
    """Raise Broken unless the message is one line with the file and a place in it."""
    text = str(error)
    _require(isinstance(error, DataError), f"{type(error).__name__} instead of DataError: {text}")
    _require("\n" not in text and "\r" not in text, f"several lines: {text}")
    _require(len(text) <= LONGEST_LINE, f"{len(text)} characters: {text[:200]}")
    _require(text.isprintable(), f"unprintable: {text!r}")
    _require(file in text, f"{file} is not named: {text}")
    _require(PLACE.search(text) or WHOLE_FILE.search(text), f"no place: {text}")


def _vehicle(path: Path) -> Vehicle:
    return Vehicle("fuzzed", path.with_name("vehicle.toml"), 0.08, 0.7, 32768.0)


def _read_encoder(path: Path) -> tuple[WheelStream, tuple[Notice, ...]]:
    return read_encoder(path, _vehicle(path))


def _stream(read: Callable[[Path], Any], check: Callable[[Any], None], answer: str) -> Callable[[Path], str]:
    """A reader of one stream and its notices as a target."""

    def feed_stream(path: Path) -> str:
        stream, notices = read(path)
        check(stream)
        _check_notices(notices)
        return answer

    return feed_stream


def _vehicle_toml(path: Path) -> str:
    vehicle, notices = read_vehicle(path)
    _require(np.isfinite([vehicle.wheel_radius_m, vehicle.track_m]).all(), "vehicle: not finite")
    _require(1e-4 < vehicle.wheel_radius_m < 1e3 and 1e-3 < vehicle.track_m < 1e3, "vehicle: sizes of no vehicle")
    _require(vehicle.ticks_per_rev is None or 0 < vehicle.ticks_per_rev <= 1e12, "vehicle: ticks_per_rev out of range")
    _check_notices(notices)
    return "vehicle"


def _message_log(path: Path) -> str:
    wheels, heading, fixes, notices = read_message_log(path, _vehicle(path), ReadOptions())
    check_wheels(wheels)
    check_heading(heading)
    check_fixes(fixes)
    _check_notices(notices)
    return "run"


def _reference(path: Path) -> str:
    rows = read_reference_rows(path)
    _require((np.abs(rows.lat_deg) <= 90).all() and (np.abs(rows.lon_deg) <= 360).all(), "reference: no positions")
    _require(((rows.quality >= -1) & (rows.quality <= 9)).all(), "reference: qualities out of range")
    times = rows.t_s[np.isfinite(rows.t_s)]
    _require((np.abs(times) <= TIME_LIMIT_S).all() and not np.isinf(rows.t_s).any(), "reference: times out of range")
    path.with_name(MANIFEST_FILE).write_text("{}")
    fixes, _ = read_gnss_csv(_written(path.with_name("gnss.csv"), run_files()["gnss.csv"]))
    read_reference(path.parent, fixes)
    return "reference"


def _written(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


def _laid_out(path: Path) -> Path:
    """A folder with a whole run of which one file, named in the first line of ``path``, holds the rest of it."""
    name, _, data = path.read_bytes().partition(b"\n")
    chosen = name.decode("ascii", "replace").strip()
    folder = path.with_name("run")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    fixes = "gnss.csv" if chosen == "gnss.csv" else "gnss.nmea"
    names = {"encoder.csv", "ahrs.csv", "vehicle.toml", fixes}
    if chosen == "reference.csv":
        names |= {chosen, MANIFEST_FILE}
    for one in names:
        (folder / one).write_bytes(data if one == chosen else run_files()[one])
    return folder


def _align(path: Path) -> str:
    (source,) = discover([_laid_out(path)])
    try:
        check_aligned(align(read_run(source)))
    except DataError as error:
        text = str(error)
        _require("\n" not in text and len(text) <= LONGEST_LINE and text.isprintable(), f"several lines: {text!r}")
        return "refused"
    return "aligned"


def _cli(path: Path) -> str:
    return "calibrated" if _commanded(["calibrate", str(_laid_out(path))], path) else "refused"


def _rewritten(path: Path) -> str:
    """A run degraded, and the same run converted to the other form."""
    alone = path.suffix == ".mcap"
    folder = path.with_name("run") if alone else _laid_out(path)
    if alone:
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        shutil.copy(path, folder / path.name)
        (folder / "vehicle.toml").write_bytes(run_files()["vehicle.toml"])
    faults = ["--sigma", "1", "--loss", "0.3:0.8", "--outliers", "0.1", "--encoder-dropout", "0.1"]
    done = [_commanded(["degrade", str(folder), *faults], path), _commanded(["convert", str(folder)], path)]
    return "rewritten" if any(done) else "refused by both"


def _commanded(arguments: list[str], path: Path) -> bool:
    """Whether a command gave a result; its output goes beside ``path`` and away again."""
    from sccal.cli import main

    out, err = io.StringIO(), io.StringIO()
    argv, sys.argv = sys.argv, ["sccal", *arguments, "--out", str(path.with_name("out"))]
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main()
    except SystemExit as end:
        code = end.code or 0
    else:
        code = 0
    finally:
        sys.argv = argv
        shutil.rmtree(path.with_name("out"), ignore_errors=True)
    allowed = (0, 2, 3) if "--loss" in arguments else (0, 3)  # a changed run may end before the loss begins
    _require(code in allowed, f"exit code {code}: {err.getvalue()[-2000:]}")
    lines = [line for line in err.getvalue().splitlines() if not line.startswith("compiling the filter")]
    _require(len(lines) == (code != 0), f"exit code {code} with {len(lines)} lines: {err.getvalue()[-2000:]}")
    return code == 0


READERS = {
    reader.name: reader
    for reader in (
        Reader("encoder", "encoder.csv", _stream(_read_encoder, check_wheels, "wheels")),
        Reader("ahrs", "ahrs.csv", _stream(read_ahrs, check_heading, "heading")),
        Reader("gnss_csv", "gnss.csv", _stream(read_gnss_csv, check_fixes, "fixes")),
        Reader("nmea", "gnss.nmea", _stream(read_nmea, check_fixes, "fixes")),
        Reader("nmea_heading", "gnss.nmea", _stream(read_nmea_heading, check_heading, "heading")),
        Reader("vehicle", "vehicle.toml", _vehicle_toml),
        Reader("reference", "reference.csv", _reference),
        Reader("mcap", "log.mcap", _message_log, text=False),
        Reader("db3", "log.db3", _message_log, text=False),
        Reader("bag", "log.bag", _message_log, text=False),
        Reader("align", "input", _align, limit_s=20.0),
        Reader("cli", "input", _cli, limit_s=60.0),
        Reader("rewritten", "input", _rewritten, limit_s=20.0),
        Reader("mcap_rewritten", "log.mcap", _rewritten, text=False, limit_s=20.0),
    )
}


def feed(reader: Reader, data: bytes, folder: Path) -> str:
    """Give the bytes to a reader as its file in ``folder``; what came out, in a word, or the message of its refusal.

    Raises whatever must not happen.
    """
    path = _written(folder / reader.file, data)
    with _limited(reader.limit_s):
        try:
            return reader.feed(path)
        except SccalError as error:
            check_error(error, reader.file)
            return str(error)


@contextlib.contextmanager
def _limited(limit_s: float) -> Iterator[None]:
    """Raise Stuck after so much processor time."""

    def stop(_signal: int, _frame: FrameType | None) -> None:
        raise Stuck(f"more than {limit_s:g} s")

    before = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, limit_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def signature(error: BaseException) -> str:
    """What tells one finding from another: the kind of failure, and the innermost line of ours that it came through."""
    place = ""
    trace = error.__traceback__
    while trace is not None:
        code = trace.tb_frame.f_code
        if "/sccal/" in code.co_filename:
            place = f"{Path(code.co_filename).stem}.{code.co_name}"
        trace = trace.tb_next
    words = re.sub(r"[^a-z ]+", " ", str(error).split(":")[0].lower()).split()[:5] if isinstance(error, Broken) else []
    return "-".join([type(error).__name__, place, *words]).strip("-")
