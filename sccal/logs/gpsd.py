"""gpsd's reports as JSON, one on each line, as ``gpspipe -w`` logs them: the fixes of the class TPV.

Source: gpsd_json(5): mode 2 and 3 are fixes; status 2 is DGPS, 3 RTK fixed, 4 RTK floating, 5 and 6 dead reckoning, 7 a
surveyed place, 8 simulated, 9 P(Y); epx and epy are errors east and north, eph the horizontal one, all at 95 %.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from sccal.arrays import Floats
from sccal.errors import DataError
from sccal.logs.compressed import bytes_of, head_of
from sccal.logs.limits import SIGMA_LIMIT_M
from sccal.logs.quality_words import mapped
from sccal.logs.streams import FixStream, Notice

_STATUS = {1: 1, 2: 2, 3: 4, 4: 5, 5: 6, 6: 6, 7: 7, 8: 8, 9: 3}
_OF_AXIS, _OF_PLANE = 1.0 / 1.96, 1.0 / 2.448
"""One standard deviation of what 95 % lie within, in one axis and in the plane."""
_FIX_MODE = 2


def looks_like_gpsd(path: Path) -> bool:
    """Whether a file begins with a report and not with a sentence."""
    try:
        return head_of(path, 256).lstrip().startswith(b'{"class"')
    except DataError:
        return False


def read_gpsd(path: Path) -> tuple[FixStream, tuple[Notice, ...]]:
    """The fixes of a log of reports; their epochs are UTC, for it has no receive times.

    Raises:
        DataError: unreadable file, or no report with a place and a time.
    """
    lines = bytes_of(path).decode(errors="replace").splitlines()
    rows, odd, without = [], 0, 0
    for report in _reports(lines):
        if report is None:
            odd += 1
        elif report.get("class") == "TPV":
            row = _row(report)
            without += row is None
            if row is not None:
                rows.append(row)
    if not rows:
        raise DataError(
            f"{path}: none of {without} reports of class TPV holds a time, lat and lon ({len(lines)} lines, {odd} of "
            "them no JSON): wait for a fix, and log with `gpspipe -w`"
        )
    notices = [Notice(path.name, "TPV reports of gpsd read as fixes", len(rows))]
    if odd:
        notices.append(Notice(path.name, "lines that are no JSON dropped", odd))
    if without:
        notices.append(Notice(path.name, "TPV reports without a fix passed over", without))
    return _fixes(np.array(rows)), tuple(notices)


def _reports(lines: list[str]) -> Iterator[dict[str, Any] | None]:
    """Each line's report; None where it is none."""
    for line in lines:
        text = line[max(line.find("{"), 0) :].strip()
        if text:
            try:
                report = json.loads(text)
            except ValueError:
                yield None
            else:
                yield report if isinstance(report, dict) else None


def _row(report: dict[str, Any]) -> list[float] | None:
    """Time, latitude, longitude, height, status, and sigmas east and north; None without a fix."""

    def number(*names: str) -> float:
        given = next((report[name] for name in names if isinstance(report.get(name), int | float)), None)
        return float("nan") if given is None else float(given)

    try:
        utc_s = datetime.fromisoformat(str(report["time"]).replace("Z", "+00:00")).replace(tzinfo=UTC).timestamp()
    except (KeyError, ValueError):
        return None
    lat, lon = number("lat"), number("lon")
    if not (abs(lat) <= 90.0 and abs(lon) <= 180.0) or number("mode") < _FIX_MODE:
        return None
    plane = number("eph") * _OF_PLANE
    east, north = number("epx") * _OF_AXIS, number("epy") * _OF_AXIS
    axes = [axis if np.isfinite(axis) else plane for axis in (east, north)]
    return [utc_s, lat, lon, number("altHAE", "alt", "altMSL"), number("status"), *axes]


def _fixes(rows: Floats) -> FixStream:
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    rows = rows[np.concatenate(([True], np.diff(rows[:, 0]) > 0.0))]
    status = mapped(rows[:, 4], _STATUS)
    sigma = np.where(rows[:, 5:7] > 0.0, np.minimum(rows[:, 5:7], SIGMA_LIMIT_M), np.nan)
    return FixStream(
        host_t_s=np.full(rows.shape[0], np.nan),
        utc_s=rows[:, 0],
        utc_has_date=True,
        lat_deg=rows[:, 1],
        lon_deg=rows[:, 2],
        alt_m=rows[:, 3],
        quality=np.where(np.isfinite(status), status, -1.0).astype(np.int64),
        sigma_east_m=sigma[:, 0],
        sigma_north_m=sigma[:, 1],
        cov_en_m2=np.zeros(rows.shape[0]),
    )
