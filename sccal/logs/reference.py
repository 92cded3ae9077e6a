"""``reference.csv`` beside ``degrade.json``: a degraded log's fixes as they were, to judge by and not to learn from.

    t,lat_deg,lon_deg,quality,state[,utc_s]

One row for each fix, in order of time. ``t`` is on the logging computer's clock, empty where the log has no receive
time; ``utc_s`` is there for NMEA only: Unix time, or the running time of day where the log has no date. ``quality`` is
as in GGA, -1 where not stated. ``state`` is what the faults made of the fix: ``lost``, ``displaced`` or ``same``.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from sccal.arrays import Bools, Floats, Ints
from sccal.errors import DataError
from sccal.logs.limits import TIME_LIMIT_S
from sccal.logs.streams import FixStream, Reference

REFERENCE_FILE = "reference.csv"
MANIFEST_FILE = "degrade.json"
_LONGEST_HEADER = 1000
_COLUMNS = ["t", "lat_deg", "lon_deg", "quality", "state"]
STATES = ("same", "displaced", "lost")


@dataclass(frozen=True)
class ReferenceRows:
    """The fixes before the fault; arrays (n,)."""

    t_s: Floats
    """NaN where not known."""
    utc_s: Floats | None
    lat_deg: Floats
    lon_deg: Floats
    quality: Ints
    lost: Bools
    displaced: Bools

    @property
    def state(self) -> Ints:
        """(n,) places in STATES."""
        return np.where(self.lost, 2, np.where(self.displaced, 1, 0))


def read_reference_rows(path: Path) -> ReferenceRows:
    """A reference file's rows. Raises DataError where the file is none."""
    try:
        table = _table(path.read_bytes())
        numbers = {name: _numbers(table[name]) for name in table.columns if name != "state"}
        _require_ranges(numbers)
        quality = numbers["quality"].astype(np.int64)
    except (OSError, ValueError) as error:
        why = " ".join(str(error).split())
        raise DataError(f"{path}: is not the reference of a degraded log ({why}); degrade it again") from error
    state = table["state"].to_numpy()
    return ReferenceRows(
        t_s=numbers["t"],
        utc_s=numbers.get("utc_s"),
        lat_deg=numbers["lat_deg"],
        lon_deg=numbers["lon_deg"],
        quality=quality,
        lost=np.asarray(state == "lost"),
        displaced=np.asarray(state == "displaced"),
    )


def _table(data: bytes) -> pd.DataFrame:
    """The columns below the header; raises ValueError where they are not those of a reference."""
    header = data[: data.find(b"\n", 0, _LONGEST_HEADER) + 1]
    names = [name.strip() for name in header.decode("utf-8", "replace").split(",")]
    if names[: len(_COLUMNS)] != _COLUMNS or len(set(names)) != len(names):
        raise ValueError(f"line 1 must begin with {','.join(_COLUMNS)}; the file has {len(data)} bytes")
    width = header.count(b",")
    odd = next((i for i, row in enumerate(data.splitlines(), 1) if row.count(b",") != width), 0)
    if odd:
        raise ValueError(f"line {odd} has not {width + 1} cells")
    table = pd.read_csv(io.BytesIO(data), dtype={"state": str}, index_col=False, skip_blank_lines=False)
    table.columns = pd.Index(names)
    wrong = ~table["state"].isin(STATES).to_numpy(dtype=np.bool_)
    if wrong.any():
        raise ValueError(f"line {_line(wrong)}: state is none of {', '.join(STATES)}")
    return table


def _require_ranges(numbers: Mapping[str, Floats]) -> None:
    """Raise ValueError with the line of the first number that cannot be one of a fix."""
    quality = numbers["quality"]
    times = [numbers[name] for name in ("t", "utc_s") if name in numbers]
    for wrong, what in (
        (~((np.abs(numbers["lat_deg"]) <= 90) & (np.abs(numbers["lon_deg"]) <= 360)), "no position"),
        (~((quality >= -1) & (quality <= 9)), "quality is none of GGA's"),
        *((np.abs(time) > TIME_LIMIT_S, f"a time beyond {TIME_LIMIT_S:g} s") for time in times),
    ):
        if wrong.any():
            raise ValueError(f"line {_line(wrong)}: {what}")


def _numbers(column: pd.Series[Any]) -> Floats:
    """The cells as numbers, NaN where they are empty; raises ValueError with the line of any other."""
    values = pd.to_numeric(column, errors="coerce").to_numpy(dtype=np.float64)
    wrong = np.isnan(values) & column.notna().to_numpy(dtype=np.bool_)
    if wrong.any():
        raise ValueError(f"line {_line(wrong)}: {column.name} is no number")
    return values


def _line(wrong: Bools) -> int:
    return int(np.flatnonzero(wrong)[0]) + 2


def beside(run: Path, name: str) -> Path:
    """Where a run's REFERENCE_FILE or MANIFEST_FILE stands: in its folder, or after the name of its file."""
    return run / name if run.is_dir() else run.with_name(f"{run.name}.{name}")


def read_reference(run: Path, fixes: FixStream) -> Reference | None:
    """The reference of the run in a folder or file, whose fixes are ``fixes``; None where it was not degraded.

    Raises DataError where the file is damaged.
    """
    path = beside(run, REFERENCE_FILE)
    if not path.is_file() or not beside(run, MANIFEST_FILE).is_file():
        return None
    rows = read_reference_rows(path)
    if not (rows.lost | rows.displaced).any():
        return None
    absent = np.full(rows.t_s.size, np.nan)
    return Reference(
        FixStream(
            host_t_s=rows.t_s,
            utc_s=absent if rows.utc_s is None else rows.utc_s,
            utc_has_date=fixes.utc_has_date,
            lat_deg=rows.lat_deg,
            lon_deg=rows.lon_deg,
            alt_m=absent,
            quality=rows.quality,
            sigma_east_m=absent,
            sigma_north_m=absent,
            cov_en_m2=np.zeros(rows.t_s.size),
        ),
        rows.lost,
    )
