"""One run's folder with a fault: its files rewritten or copied, what it was before, and a manifest of what was done.

``degrade.json`` (schema ``sccal.degrade/1``) tells the program's version, where the run came from, the options with the
seed and the name that chose the noise, the windows on the run's own clock, what became of the fixes, and for every file
its digest before and after and what was changed in it. Nothing in it depends on when or where it was made.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from sccal import __version__
from sccal.degrade.faults import Faults, resolve
from sccal.degrade.nmea import degrade_nmea
from sccal.degrade.reference import after_both, reference_text
from sccal.degrade.sheet import Sheet
from sccal.degrade.tables import degrade_ahrs_csv, degrade_encoder_csv, degrade_gnss_csv
from sccal.errors import DataError
from sccal.logs.compressed import plain_name
from sccal.logs.formats import FIXES
from sccal.logs.names import AHRS_FILE, ENCODER_FILE, GNSS_FILE, NMEA_FILE, VEHICLE_FILE
from sccal.logs.outputs import Note
from sccal.logs.reference import MANIFEST_FILE, REFERENCE_FILE, ReferenceRows, beside, read_reference_rows
from sccal.logs.run import RunSource
from sccal.logs.streams import Convention
from sccal.logs.timeline import order_in_time
from sccal.logs.vehicle import read_vehicle

SCHEMA = "sccal.degrade/1"
_COPY_BYTES = 1 << 20


@dataclass(frozen=True)
class DegradedRun:
    """What was written for one run."""

    name: str
    folder: Path
    fixes: Mapping[str, int]
    """before, same, displaced, lost, outliers."""
    rows_dropped: Mapping[str, int]
    """By file."""
    notices: tuple[str, ...]


@dataclass(frozen=True)
class Task:
    """What every file of a run is rewritten with."""

    faults: Faults
    name: str
    span_s: tuple[float, float] | None
    convention: Convention


@dataclass(frozen=True)
class _Changed:
    """A file's new bytes and what the manifest says of it."""

    raw: bytes
    did: Mapping[str, object] = field(default_factory=dict)
    rows: ReferenceRows | None = None
    outliers: int = 0
    notices: tuple[str, ...] = ()


def _nmea(raw: bytes, task: Task) -> _Changed:
    done = degrade_nmea(raw, task.faults, task.span_s, task.name)
    sentences = {"rewritten": dict(sorted(done.rewritten.items())), "left": dict(sorted(done.left.items()))}
    wrong = done.left["wrong checksum"]
    notices = (f"{wrong} sentences with a wrong checksum left as they were",) if wrong else ()
    return _Changed(done.raw, {"sentences": sentences}, done.reference(), done.outliers, notices)


def _gnss_csv(raw: bytes, task: Task) -> _Changed:
    done = degrade_gnss_csv(raw, task.faults, task.span_s, task.name)
    read, fixes = done.read, done.fixes
    order = np.flatnonzero(read)[np.argsort(done.t_s[read], kind="stable")]
    rows = ReferenceRows(
        t_s=done.t_s[order],
        utc_s=None,
        lat_deg=done.lat_deg[order],
        lon_deg=done.lon_deg[order],
        quality=done.quality[order],
        lost=fixes.lost[order],
        displaced=fixes.displaced[order],
    )
    return _Changed(done.raw, {"rows_dropped": done.rows_dropped}, rows, int(fixes.outlier[read].sum()))


def _ahrs_csv(raw: bytes, task: Task) -> _Changed:
    if not task.faults.heading_drift_deg_per_hour:
        return _Changed(raw)
    new, rows = degrade_ahrs_csv(raw, task.faults, task.convention)
    return _Changed(new, {"rows_rewritten": rows})


def _encoder_csv(raw: bytes, task: Task) -> _Changed:
    if not task.faults.encoder_dropout:
        return _Changed(raw)
    new, rows = degrade_encoder_csv(raw, task.faults, task.name)
    return _Changed(new, {"rows_dropped": rows})


Rewriter = Callable[[bytes, Task], _Changed]

REWRITERS: Mapping[str, Rewriter] = {
    NMEA_FILE: _nmea,
    GNSS_FILE: _gnss_csv,
    AHRS_FILE: _ahrs_csv,
    ENCODER_FILE: _encoder_csv,
}
"""By a file's name; all others are only copied."""


def degrade_folder(source: RunSource, target: Path, faults: Faults, others: Collection[Path] = ()) -> DegradedRun:
    """Write a run with its faults into the folder ``target``, all of it or nothing.

    Folders in ``others`` (further runs) are not copied. A folder that holds files is only written into if an earlier
    call made it (it has a degrade.json); the files that this one lists are then replaced.

    Raises:
        UsageError: the folder is not ours to write into, or a window lies outside the run.
        DataError: a file that is to be rewritten is missing or cannot be read.
    """
    _NOTE.earlier_files(target)
    if source.folder is not None:
        source.folder.require_contract("degraded")
    _require_files(source.path, faults)
    notices: list[str] = []
    if faults.none:
        notices.append("no fault given: the files are as they were")
    task = Task(faults, source.name, _span_s(source.path, faults, notices), convention_of(source, faults))
    try:
        with _NOTE.staged(target) as staging:
            run = _written(source, staging, task, others, notices)
    except OSError as error:
        raise DataError(f"{error.filename or target}: cannot be read or written ({error.strerror or error})") from error
    return DegradedRun(source.name, target, run.fixes, run.rows_dropped, run.notices)


def _written(source: RunSource, staging: Path, task: Task, others: Collection[Path], notices: list[str]) -> DegradedRun:
    files: list[dict[str, object]] = []
    rows: ReferenceRows | None = None
    fixes: dict[str, int] = {}
    dropped: dict[str, int] = {}
    for relative in _files(source.path, others):
        path, new_path = source.path / relative, staging / relative
        new_path.parent.mkdir(parents=True, exist_ok=True)
        rewriter = REWRITERS.get(relative.name) if relative.parent == Path() else None
        if rewriter is None:
            digest = _copied(path, new_path)
            files.append({"name": relative.as_posix(), "sha256_before": digest, "sha256_after": digest})
            continue
        raw = path.read_bytes()
        changed = _changed(raw, path, rewriter, task, notices)
        new_path.write_bytes(changed.raw)
        notices += [f"{relative.name}: {notice}" for notice in changed.notices]
        files.append(
            {
                "name": relative.as_posix(),
                "sha256_before": hashlib.sha256(raw).hexdigest(),
                "sha256_after": hashlib.sha256(changed.raw).hexdigest(),
                **changed.did,
            }
        )
        if isinstance(count := changed.did.get("rows_dropped"), int) and count:
            dropped[relative.name] = count
        if changed.rows is not None and (rows is None or relative.name == NMEA_FILE):
            rows = changed.rows
            fixes = fix_counts(rows, changed.outliers)
    if rows is not None:
        rows = with_earlier(rows, source.path, notices)
        (staging / REFERENCE_FILE).write_bytes(reference_text(rows))
    run = DegradedRun(source.name, staging, fixes, dropped, tuple(notices))
    manifest = manifest_of(source, task, run, files, rows is not None)
    (staging / MANIFEST_FILE).write_text(json.dumps(manifest, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    return run


def _changed(raw: bytes, path: Path, rewriter: Rewriter, task: Task, notices: list[str]) -> _Changed:
    """What a rewriter makes of a file; a file that no fault concerns may be unreadable."""
    concerned = task.faults.touch_fixes if path.name in FIXES else not task.faults.none
    try:
        return rewriter(raw, task)
    except DataError as error:
        if concerned:
            raise DataError(f"{path}: {error}") from error
        notices.append(f"{path.name}: copied without being read ({error})")
        return _Changed(raw)


def fix_counts(rows: ReferenceRows, outliers: int) -> dict[str, int]:
    """What became of the fixes, as the manifest counts them."""
    same, displaced, lost = np.bincount(rows.state, minlength=3).tolist()
    return {"before": rows.lost.size, "same": same, "displaced": displaced, "lost": lost, "outliers": outliers}


def with_earlier(rows: ReferenceRows, folder: Path, notices: list[str]) -> ReferenceRows:
    """The reference of a log that was degraded before stays what it was."""
    path = beside(folder, REFERENCE_FILE)
    if not path.is_file() or not beside(folder, MANIFEST_FILE).is_file() or rows.lost.size == 0:
        return rows
    try:
        both = after_both(read_reference_rows(path), rows)
    except DataError as error:
        notices.append(f"{REFERENCE_FILE} of an earlier degradation cannot be read ({error}): made anew")
        return rows
    notices.append(f"degraded before: {REFERENCE_FILE} holds the fixes from before the first time")
    return both


def manifest_of(
    source: RunSource, task: Task, run: DegradedRun, files: list[dict[str, object]], with_reference: bool
) -> dict[str, object]:
    """The document of degrade.json."""
    windows: dict[str, object] = {}
    if task.span_s is not None:
        resolved = resolve(task.faults, task.span_s)
        windows = {
            "encoder_span_s": list(task.span_s),
            "loss_s": [list(window) for window in resolved.losses_s],
            "from_s": resolved.from_s,
        }
    manifest: dict[str, object] = {
        "schema": SCHEMA,
        "sccal": __version__,
        "run": source.name,
        "source": str(source.path),
        "noise_stream": source.name,
        "options": asdict(task.faults),
        "windows": windows,
        "fixes": dict(run.fixes),
        "reference": REFERENCE_FILE if with_reference else None,
        "files": files,
        "notices": list(run.notices),
    }
    before = beside(source.path, MANIFEST_FILE)
    if before.is_file():
        try:
            manifest["degraded_before"] = json.loads(before.read_text(encoding="utf-8"))
        except ValueError:
            manifest["degraded_before"] = None
    return manifest


def _require_files(folder: Path, faults: Faults) -> None:
    for wanted, names, what in (
        (faults.touch_fixes, FIXES, "faults of the fixes"),
        (bool(faults.heading_drift_deg_per_hour), (AHRS_FILE,), "--heading-drift"),
        (bool(faults.encoder_dropout), (ENCODER_FILE,), "--encoder-dropout"),
    ):
        if wanted and not any((folder / name).is_file() for name in names):
            packed = sorted(one.name for one in folder.iterdir() if plain_name(one.name) != one.name)
            beside = f"; compressed files ({', '.join(packed)}) are not rewritten: unpack them first" if packed else ""
            raise DataError(f"{folder}: lacks {' or '.join(names)}, which {what} would rewrite{beside}")


def _span_s(folder: Path, faults: Faults, notices: list[str]) -> tuple[float, float] | None:
    """First and last time of the encoder file, whatever else it holds; None where there is none."""
    path = folder / ENCODER_FILE
    try:
        time = Sheet(path.read_bytes(), path.name).column("t")
        values = time.values[np.isfinite(time.values)] if time is not None else np.empty(0)
        order, _ = order_in_time(values, np.arange(values.size), path.name)
        if order.size:
            return float(values[order[0]]), float(values[order[-1]])
        why = "no time in it"
    except OSError as error:
        why = error.strerror or str(error)
    except DataError as error:
        why = str(error)
    if faults.losses_s or faults.from_s is not None:
        notices.append(f"{ENCODER_FILE} cannot tell when the run begins ({why}): windows go by the fixes' own times")
    return None


def convention_of(source: RunSource, faults: Faults) -> Convention:
    """Which way the run's yaw turns, where a fault needs it. Raises DataError where nobody says."""
    if not faults.heading_drift_deg_per_hour:
        return "enu"
    if source.vehicle_toml is None:
        raise DataError(
            f"{source.path}: no {VEHICLE_FILE} here or above, so nobody knows which way its yaw turns; "
            'add one with [ahrs] convention = "enu" or "ned"'
        )
    vehicle, _ = read_vehicle(source.vehicle_toml)
    return vehicle.convention


def _files(folder: Path, others: Collection[Path]) -> Iterator[Path]:
    """The run's own files, relative to its folder: those below it too, but not those of further runs."""
    for here, below, names in os.walk(folder):
        at = Path(here)
        below[:] = sorted(name for name in below if not name.startswith(".") and at / name not in others)
        for name in sorted(names):
            relative = (at / name).relative_to(folder)
            if relative.as_posix() not in (MANIFEST_FILE, REFERENCE_FILE) and (at / name).is_file():
                yield relative


def _copied(path: Path, new_path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as old, new_path.open("wb") as new:
        while block := old.read(_COPY_BYTES):
            digest.update(block)
            new.write(block)
    return digest.hexdigest()


def _files_listed(document: Any) -> list[str]:
    if not str(document["schema"]).startswith("sccal.degrade/"):
        raise ValueError(document["schema"])
    return [REFERENCE_FILE, *(one["name"] for one in document["files"])]


_NOTE = Note(MANIFEST_FILE, "manifest", "degrade", _files_listed)
