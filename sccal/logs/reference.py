"""``reference.csv`` beside ``degrade.json``: a degraded log's fixes as they were, to judge by and not to learn from.

    t,lat_deg,lon_deg,quality,state[,utc_s]

One row for each fix, in order of time. ``t`` is on the logging computer's clock, empty where the log has no receive
time; ``utc_s`` is there for NMEA only: Unix time, or the running time of day where the log has no date. ``quality`` is
as in GGA, -1 where not stated. ``state`` is what the faults made of the fix: ``lost``, ``displaced`` or ``same``.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from sccal.arrays import Bools, Floats, Ints
from sccal.errors import DataError
from sccal.logs.streams import FixStream, Reference

REFERENCE_FILE = "reference.csv"
MANIFEST_FILE = "degrade.json"
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
        table = pd.read_csv(io.BytesIO(path.read_bytes()), dtype={"state": str})
        if [*table.columns][: len(_COLUMNS)] != _COLUMNS or not table["state"].isin(STATES).all():
            raise ValueError(f"the columns must be {','.join(_COLUMNS)} with state {', '.join(STATES)}")
        numbers = {name: table[name].to_numpy(dtype=np.float64) for name in table.columns if name != "state"}
        if not (np.isfinite(numbers["lat_deg"]) & np.isfinite(numbers["lon_deg"])).all():
            raise ValueError("rows without a position")
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
