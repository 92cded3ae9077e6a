"""Which messages of a log a fault changes, and how: fixes, orientations, joint states, and the columns beside them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from sccal.arrays import Floats, Ints
from sccal.degrade.faults import Faults, drift_deg, dropped_rows, fault_fixes
from sccal.degrade.nmea import degrade_nmea
from sccal.errors import DataError
from sccal.logs.messages.converted import ConversionNote
from sccal.logs.messages.fixes import has_positions, lines_of_sentences
from sccal.logs.messages.heading import has_orientation
from sccal.logs.messages.topics import FIELDS, Messages, normal_path
from sccal.logs.quality import navsat_status, quality_of
from sccal.logs.reference import ReferenceRows
from sccal.logs.streams import Convention
from sccal.logs.timeline import order_in_time

_POSITIONS = ("NavSatFix", "GPSFix", "LocationFix")


@dataclass
class Changes:
    """What to do to the messages, by topic and number from 1."""

    numbers: dict[tuple[str, int], dict[str, float]] = field(default_factory=dict)
    texts: dict[tuple[str, int], bytes] = field(default_factory=dict)
    dropped: set[tuple[str, int]] = field(default_factory=set)
    rewritten: Counter[str] = field(default_factory=Counter)
    """Messages by topic."""
    left_out: Counter[str] = field(default_factory=Counter)
    rows: ReferenceRows | None = None
    outliers: int = 0

    def put(self, topic: str, number: int, path: str, value: float) -> None:
        """A new number for a field."""
        key = topic, number
        if key not in self.numbers:
            self.numbers[key] = {}
            self.rewritten[topic] += 1
        self.numbers[key][normal_path(path)] = value

    def drop(self, topic: str, number: int) -> None:
        """Leave a message out."""
        self.dropped.add((topic, number))
        self.left_out[topic] += 1


@dataclass(frozen=True)
class LogOfMessages:
    """What of a log is needed to degrade it."""

    found: Mapping[str, Messages]
    note: ConversionNote | None
    convention: Convention
    name: str

    def of_kinds(self, *kinds: str) -> list[Messages]:
        """The topics of these kinds, the kinds in order."""
        return [m for kind in kinds for m in self.found.values() if m.kind == kind]

    @property
    def wheels(self) -> list[Messages]:
        """The topics that hold wheels."""
        return self.of_kinds("JointState") or self.of_kinds("Odometry")

    @property
    def span_s(self) -> tuple[float, float] | None:
        """First and last time of the wheels; None where there are none."""
        for one in self.wheels:
            t_s = one.t_s[np.isfinite(one.t_s)]
            order, _ = order_in_time(t_s, np.arange(t_s.size), one.topic)
            if order.size:
                return float(t_s[order[0]]), float(t_s[order[-1]])
        return None


def changes_of(log: LogOfMessages, faults: Faults) -> Changes:
    """The changes that the faults ask for.

    Raises:
        DataError: the log lacks what a fault would change.
        UsageError: a window outside the run.
    """
    changes = Changes()
    if faults.touch_fixes:
        sentences = [m for m in log.of_kinds("Sentence") if has_positions(m)]
        positions = log.of_kinds(*_POSITIONS)
        if not sentences and not positions:
            raise DataError("no topic with fixes (Sentence, NavSatFix, GPSFix, LocationFix), which faults would change")
        for one in sentences:
            _sentences(one, log, faults, changes)
        for one in positions:
            _positions(one, log, faults, changes)
    if faults.heading_drift_deg_per_hour:
        turned = [m for m in log.of_kinds("Imu", "QuaternionStamped") if has_orientation(m).any()]
        if not turned:
            raise DataError("no topic with orientations (Imu, QuaternionStamped), which --heading-drift would turn")
        for one in turned:
            _drift(one, log, faults, changes)
    if faults.encoder_dropout:
        if not log.wheels:
            raise DataError("no topic with wheels (JointState, Odometry), which --encoder-dropout would thin out")
        for one in log.wheels:
            gone = dropped_rows(one.t_s, faults.encoder_dropout, faults.seed, log.name)
            for number in one.number[gone].tolist():
                changes.drop(one.topic, number)
    return changes


def _sentences(messages: Messages, log: LogOfMessages, faults: Faults, changes: Changes) -> None:
    note = log.note
    places = note.nmea_places if note is not None and note.nmea_topic == messages.topic else None
    raw = lines_of_sentences(messages, places)
    done = degrade_nmea(raw, replace(faults, drop=False), log.span_s, log.name)
    before, after = raw.split(b"\n"), done.raw.split(b"\n")
    kept = after
    if faults.drop:
        kept = degrade_nmea(raw, faults, log.span_s, log.name).raw.split(b"\n")
    at = 0
    for row, number in enumerate(messages.number.tolist()):
        if faults.drop:
            if at >= len(kept) or kept[at] != after[row]:
                changes.drop(messages.topic, number)
                continue
            at += 1
        if before[row] != after[row]:
            changes.texts[messages.topic, number] = after[row][after[row].find(b"$") :]
            changes.rewritten[messages.topic] += 1
    if changes.rows is None:
        changes.rows, changes.outliers = done.reference(), done.outliers


def _positions(messages: Messages, log: LogOfMessages, faults: Faults, changes: Changes) -> None:
    order = np.argsort(messages.t_s, kind="stable")
    messages = messages.take(order)
    lat, lon = messages.column("latitude"), messages.column("longitude")
    with np.errstate(invalid="ignore"):
        placed = (np.abs(lat) <= 90) & (np.abs(lon) <= 360) & ((lat != 0) | (lon != 0)) & np.isfinite(messages.t_s)
    messages, lat, lon = messages.keep(placed), lat[placed], lon[placed]
    if lat.size == 0:
        return
    side = _side(log, "gnss", messages)
    var = [messages.column(f"cov_{axis}") for axis in ("ee", "nn")]
    stated = (var[0] > 0) & (var[1] > 0) & (messages.column("cov_type") != 0)
    quality = quality_of(messages.column("status"), np.sqrt(np.where(stated, np.maximum(*var), np.nan)))
    if "fix_quality" in side:
        given = side["fix_quality"].values
        quality = np.where(np.isfinite(given), np.round(np.nan_to_num(given)), -1).astype(np.int64)
    span_s = log.span_s or (float(messages.t_s[0]), float(messages.t_s[-1]))
    read = quality != 0
    done = fault_fixes(messages.t_s, lat, lon, quality, faults, span_s, log.name, read=read)
    topic, with_status = messages.topic, np.isfinite(messages.column("status"))
    paths = FIELDS[messages.kind]
    widened = done.noisy & ~done.lost & (faults.noise_m > 0)
    claimed = ~done.lost & (done.quality != quality) & (quality > 0)
    for row in np.flatnonzero(done.lost | done.displaced | widened | claimed).tolist():
        number = int(messages.number[row])
        if done.lost[row]:
            if faults.drop or not with_status[row]:
                changes.drop(topic, number)
                continue
            changes.put(topic, number, paths["status"], -1)
            for name in ("latitude", "longitude", "altitude"):
                changes.put(topic, number, paths[name], float("nan"))
            _put_side(side, "fix_quality", row, 0.0, changes)
            continue
        if done.displaced[row]:
            changes.put(topic, number, paths["latitude"], float(done.lat_deg[row]))
            changes.put(topic, number, paths["longitude"], float(done.lon_deg[row]))
            if "lon_deg" in side:
                moved_lon = side["lon_deg"].values[row] + (done.lon_deg[row] - lon[row] + 180) % 360 - 180
                _put_side(side, "lon_deg", row, float(moved_lon), changes)
        if claimed[row]:
            if with_status[row]:
                changes.put(topic, number, paths["status"], navsat_status(int(done.quality[row])))
            _put_side(side, "fix_quality", row, float(done.quality[row]), changes)
        if widened[row]:
            if stated[row]:
                for name, variance in (("cov_ee", var[0]), ("cov_nn", var[1])):
                    changes.put(topic, number, paths[name], float(variance[row]) + faults.noise_m**2)
            for name in ("sigma_m", "sigma_east_m", "sigma_north_m"):
                if name in side:
                    _put_side(side, name, row, float(np.hypot(side[name].values[row], faults.noise_m)), changes)
    if changes.rows is None:
        changes.rows = ReferenceRows(
            messages.t_s[read], None, lat[read], lon[read], quality[read], done.lost[read], done.displaced[read]
        )
        changes.outliers = int(done.outlier[read].sum())


def _drift(messages: Messages, log: LogOfMessages, faults: Faults, changes: Changes) -> None:
    """Turn orientations about the vertical, counter-clockwise: q' = q_z(δ) q."""
    messages = messages.keep(has_orientation(messages))
    messages = messages.take(np.argsort(messages.t_s, kind="stable"))
    half = 0.5 * np.radians(drift_deg(messages.t_s, faults.heading_drift_deg_per_hour, "enu"))
    cos, sin = np.cos(half), np.sin(half)
    x, y, z, w = (messages.column(axis) for axis in "xyzw")
    turned = {"x": cos * x - sin * y, "y": cos * y + sin * x, "z": cos * z + sin * w, "w": cos * w - sin * z}
    paths = FIELDS[messages.kind]
    rows = np.flatnonzero(half != 0)
    numbers = messages.number.tolist()
    for axis, values in turned.items():
        for row, value in zip(rows.tolist(), values[rows].tolist(), strict=True):
            changes.put(messages.topic, numbers[row], paths[axis], value)
    side = _side(log, "ahrs", messages)
    own = drift_deg(messages.t_s, faults.heading_drift_deg_per_hour, log.convention)
    for name, drift in (("yaw_deg", own), ("yaw_rad", np.radians(own))):
        if name in side:
            for row in rows.tolist():
                _put_side(side, name, row, float(side[name].values[row] + drift[row]), changes)


@dataclass(frozen=True)
class _Side:
    """A column beside a converted log's messages, at their rows (n)."""

    topic: str
    number: Ints
    """Of the message; 0 where there is none."""
    values: Floats


def _side(log: LogOfMessages, kind: str, messages: Messages) -> dict[str, _Side]:
    table = log.note.tables.get(kind) if log.note is not None else None
    if table is None or table.topic != messages.topic:
        return {}
    sides = {}
    for name, topic in table.side.items():
        one = log.found.get(topic)
        if one is None or "+data" not in one.values or messages.t_s.size == 0:
            continue
        at = np.minimum(np.searchsorted(messages.t_s, one.t_s), messages.t_s.size - 1)
        same = np.abs(messages.t_s[at] - one.t_s) <= 1e-9
        number, values = np.zeros(messages.t_s.size, dtype=np.int64), np.full(messages.t_s.size, np.nan)
        number[at[same]], values[at[same]] = one.number[same], one.values["+data"][same]
        sides[name] = _Side(topic, number, values)
    return sides


def _put_side(side: Mapping[str, _Side], name: str, row: int, value: float, changes: Changes) -> None:
    if name in side and side[name].number[row]:
        changes.put(side[name].topic, int(side[name].number[row]), "data", value)
