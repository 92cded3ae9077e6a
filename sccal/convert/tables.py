"""A run as the tables and lines of its files, before any repair, and how many decimals its numbers have."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from sccal.arrays import Bools, Floats, Ints
from sccal.errors import DataError
from sccal.logs.messages.write import nanoseconds_of
from sccal.logs.streams import Notice, Vehicle

MOST_PLACES = 9
NOTE_FILE = "convert.json"
"""In a folder that was converted: that it was, from what, which files, and what was told."""
_LATEST_S = 2**31 - 2


@dataclass(frozen=True)
class LogTable:
    """The readable rows (n) of one file in order of time."""

    t_s: Floats
    columns: Mapping[str, Floats]
    """All but t, in their order; NaN where a cell is empty."""
    written: Mapping[str, int] = field(default_factory=dict)
    """Decimals with which a file wrote its columns and t, where all its rows have as many."""

    @property
    def time_places(self) -> int | None:
        """Decimals of the times; None where they have as many as a float needs."""
        return self._at_least(time_places(self.t_s), "t")

    @property
    def places(self) -> dict[str, int | None]:
        """Decimals of every column; None where they have as many as a float needs."""
        return {name: self._at_least(value_places(column), name) for name, column in self.columns.items()}

    def _at_least(self, places: int | None, name: str) -> int | None:
        return None if places is None else max(places, self.written.get(name, 0))


@dataclass(frozen=True)
class NmeaLines:
    """Lines (n) of an NMEA log that hold a sentence, in file order."""

    texts: tuple[bytes, ...]
    """From the first ``$`` on."""
    host_t_s: Floats
    """Receive time; NaN where the line has none."""
    shown_s: Floats
    """The receive time, else the receiver's own as Unix time: where a viewer is to show the line."""

    @property
    def stamped(self) -> Bools:
        """(n) which lines have a receive time."""
        return np.isfinite(self.host_t_s)


@dataclass(frozen=True)
class RunTables:
    """One run. ``ahrs`` is None where the sentences hold the heading; of ``gnss`` and ``nmea`` one is there."""

    name: str
    path: Path
    vehicle: Vehicle
    vehicle_text: bytes
    encoder: LogTable
    ahrs: LogTable | None
    gnss: LogTable | None
    nmea: NmeaLines | None
    notices: tuple[Notice, ...]
    """Of what was met before the tables, and will not be met again in what is written."""


def stamps_of(t_s: Floats, path: Path) -> Ints:
    """Times (n) in whole nanoseconds. Raises DataError where ROS stamps cannot hold them."""
    if t_s.size and not (t_s.min() >= -_LATEST_S and t_s.max() <= _LATEST_S):
        far = t_s[np.argmax(np.abs(t_s))]
        raise DataError(f"{path}: t = {far:.6g} s is more than ROS messages can hold (±2^31 s); give t in seconds")
    return nanoseconds_of(t_s)


def time_places(t_s: Floats) -> int | None:
    """The fewest decimals with which these times (n) are still the same floats; None where 9 are too few."""
    for places in range(MOST_PLACES + 1):
        if places >= 7 and t_s.size and np.abs(t_s).max() >= 1e8:
            return 7
        if (np.abs(np.round(t_s, places) - t_s) <= np.spacing(np.abs(t_s))).all():
            return places
    return None


def value_places(values: Floats) -> int | None:
    """The fewest decimals with which these numbers (n) are written exactly, up to 8; None where they need more."""
    known = values[np.isfinite(values)]
    if known.size and np.abs(known).max() >= 2**53:
        return None
    for places in range(MOST_PLACES):
        if (np.round(known, places) == known).all():
            return places
    return None
