"""A vehicle.toml for logs of any names and columns, with why for each of its lines, and what no log can tell."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from sccal.align import align
from sccal.errors import DataError, UsageError
from sccal.inspect.read import metres_per_count, track_by_turning_m
from sccal.logs.column_names import contract_names
from sccal.logs.folder import listed_folder
from sccal.logs.formats import MESSAGE_SUFFIXES, may_be_table
from sccal.logs.limits import TICKS_PER_REV, WHEEL_RADIUS_M
from sccal.logs.mapping import NMEA_FORMAT, shown
from sccal.logs.names import AHRS_FILE, ENCODER_FILE, GNSS_FILE, NMEA_FILE, VEHICLE_FILE, natural_key
from sccal.logs.nmea import read_nmea_heading
from sccal.logs.run import RunSource, read_run
from sccal.logs.streams import HeadingStream
from sccal.logs.vehicle import read_mapping
from sccal.logs.write import write_text
from sccal.propose.details import Details, details_of
from sccal.propose.document import Column, Facts, MappedSection, document_of
from sccal.propose.headings import Heading, heading_in
from sccal.propose.places import Places, exchanged, places_in, require_grid
from sccal.propose.sense import turning_by_path
from sccal.propose.tables import Folder, Logged, looked_into
from sccal.propose.wheels import CLEARLY_BETTER, Wheels, WheelUnit, clock_of_wheels, unit_of, wheels_in, with_course
from sccal.propose.words import called

STAND_IN_TRACK_M = 1.0
"""Where the drive turns too little to show a track: a round number, to be put right by the user."""
_NO_FIXES = "no fixes: no two columns that are latitude and longitude, or metres east and north, and move"
_CANDIDATES = 12
"""Pairs of columns that may be fixes: more are tried by nobody's patience."""
_FOLDERS = 200
"""More runs of one vehicle show no more of its columns."""
_CONTRACT = {
    "encoder": (ENCODER_FILE, (("t", "left_ticks", "right_ticks"), ("t", "left_rad", "right_rad"))),
    "ahrs": (AHRS_FILE, (("t", "yaw_deg"), ("t", "yaw_rad"))),
    "gnss": (GNSS_FILE, (("t", "lat_deg", "lon_deg"),)),
}
_CONTRACT_NAMES = {
    **{("time", "s"): "t", ("left", "ticks"): "left_ticks", ("right", "ticks"): "right_ticks"},
    **{("left", "rad"): "left_rad", ("right", "rad"): "right_rad"},
    **{("heading", "deg"): "yaw_deg", ("heading", "rad"): "yaw_rad"},
    **{("latitude", "deg"): "lat_deg", ("longitude", "deg"): "lon_deg"},
    **{("height", "m"): "alt_m", ("quality", ""): "fix_quality", ("sigma", "m"): "sigma_m"},
}
"""What the contract calls a key's column in a unit."""


@dataclass(frozen=True)
class Told:
    """What the user knows and no log shows."""

    radius_m: float | None = None
    ticks_per_turn: float | None = None
    crs: str = ""

    def checked(self) -> Told:
        """As it is, with the grid spelled as the mapping does. Raises UsageError for what can be nothing."""
        for option, value, (low, high) in (
            ("--radius-m", self.radius_m, WHEEL_RADIUS_M),
            ("--ticks-per-turn", self.ticks_per_turn, TICKS_PER_REV),
        ):
            if value is not None and not low <= value <= high:
                raise UsageError(f"{option} {value:g}: must lie from {low:g} to {high:g}")
        try:
            return replace(self, crs=require_grid(self.crs.strip()))
        except ValueError as error:
            raise UsageError(f"--crs {error}") from error


@dataclass(frozen=True)
class Proposal:
    """The text of a vehicle.toml, and how it came about."""

    text: str
    looked_at: Path
    """The run's folder that shows it."""
    runs: int
    reasons: tuple[str, ...]
    """Why each file, column, unit and sign."""
    doubts: tuple[str, ...]
    """What the log could not tell, and what to put in."""
    refusal: str
    """What a calibration would still refuse; empty where it would not."""


@dataclass(frozen=True)
class _Found:
    """The streams of one run."""

    folder: Folder
    places: Places
    details: Details
    wheels: Wheels
    heading: Heading | HeadingStream
    others: tuple[str, ...]


def propose(root: Path, told: Told) -> Proposal:
    """Look at the largest run below a folder, and check that the other runs have the same columns.

    Raises:
        DataError: nothing that can be a run, or one without wheels, heading or fixes that go together.
    """
    folders = list(_run_folders(root))
    if not folders:
        raise DataError(
            f"{root}: no table (CSV, TXT, TSV, LOG, DAT) and no NMEA sentences in this folder or below; "
            f"{', '.join('*' + suffix for suffix in MESSAGE_SUFFIXES)} need no mapping, see sccal inspect"
        )
    main = max(folders, key=_bytes_in)
    found = _found(looked_into(main), told)
    scaled = _scaled(found.wheels, found.places)
    unit = unit_of(scaled, told.radius_m, told.ticks_per_turn)
    track_m, track_doubts = _track(scaled, found.heading)
    sections, pattern_doubts = _sections(found, unit, folders)
    reasons = _reasons(found, unit, sections, track_m)
    convention = found.heading.convention or "enu"
    facts = Facts(root.resolve().name or "robot", unit.radius_m, track_m, unit.ticks_per_rev, convention)
    checks = _checks(unit, bool(track_doubts))
    text = document_of(facts, sections, checks)
    refusal = _refusal(text, main)
    if refusal and not found.places.named:
        raise _lacks(found.folder, _NO_FIXES, [f"tried in vain: {found.places.why}"])
    doubts = (*_doubts(found), *unit.doubts, *track_doubts, *pattern_doubts, *_of_other_runs(text, main, folders))
    return Proposal(text, main, len(folders), reasons, doubts, refusal)


def _run_folders(root: Path) -> Iterator[Path]:
    """Folders that hold tables or sentences, but for those of results."""
    found = 0
    for folder, below, files in os.walk(root):
        below[:] = sorted(
            (name for name in below if not name.startswith(".")), key=lambda name: natural_key(Path(name))
        )
        if "calibration.json" in files or "vehicle.json" in files:
            below.clear()
            continue
        if any(may_be_table(name) or name.lower().endswith(".nmea") for name in files):
            found += 1
            yield Path(folder)
        if found >= _FOLDERS:
            return


def _bytes_in(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.iterdir() if path.is_file())


def _found(folder: Folder, told: Told) -> _Found:
    """Fixes first, then what goes with them. Raises DataError with what was seen where anything is missing."""
    candidates = places_in(folder, told.crs)
    if not candidates:
        raise _lacks(folder, _NO_FIXES, [])
    places, wheels, others = _best_pair(folder, candidates)
    if wheels is None and not places.named:
        raise _lacks(folder, _NO_FIXES, [])
    if wheels is None:
        lack = "no wheels: no two columns whose steps or integrals follow the way of the fixes"
        raise _lacks(folder, lack, [f"{places.file}: {places.why}"])
    details = details_of(places)
    used = {*_columns_of(places, details), (wheels.table.name, wheels.left), (wheels.table.name, wheels.right)}
    heading, like = heading_in(folder, places, wheels, frozenset(used))
    if heading is not None and not (wheels.course.clear and heading.unit_shown):
        by_path = turning_by_path(places, wheels, heading)
        if by_path is not None and not wheels.course.clear:
            wheels = with_course(wheels, by_path)
            heading, like = heading_in(folder, places, wheels, frozenset(used))
        heading = None if heading is None else replace(heading, unit_shown=heading.unit_shown or by_path is not None)
    unused = [one.why for one in candidates if one.named and _names(one) != _names(places)][:3]
    found = (_beside("wheels", others), _beside("heading", like), _beside("fixes", unused))
    beside = tuple(one for one in found if one)
    if heading is not None:
        return _Found(folder, places, details, wheels, heading, beside)
    of_receiver = _receiver_heading(places, folder)
    if of_receiver is None:
        seen = [f"{places.file}: {places.why}", *(f"{wheels.table.name}: {why}" for why in wheels.why)]
        raise _lacks(folder, "no heading: no column turns as the wheels turn", seen)
    return _Found(folder, places, details, wheels, of_receiver, beside)


def _best_pair(folder: Folder, candidates: Sequence[Places]) -> tuple[Places, Wheels | None, tuple[str, ...]]:
    """Of all that may be fixes those that wheels go with best; the first named ones where others are no better."""
    best: tuple[Places, Wheels | None, tuple[str, ...]] = (candidates[0], None, ())
    for named in candidates[:_CANDIDATES]:
        places, wheels, others = _on_one_clock(folder, named)
        other = None if wheels is None else exchanged(places, wheels.t_s, wheels.left_sum + wheels.right_sum)
        if other is not None:
            places = other
            wheels, others = _wheels_of(folder, places)
        if wheels is not None and wheels.explained > (best[1].explained + CLEARLY_BETTER if best[1] else 0.0):
            best = (places, wheels, others)
    return best


def _on_one_clock(folder: Folder, places: Places) -> tuple[Places, Wheels | None, tuple[str, ...]]:
    """The wheels that go with some fixes, which are moved to their clock where they share none."""
    wheels, others = _wheels_of(folder, places)
    moved = clock_of_wheels(folder, places) if wheels is None else None
    return (places, wheels, others) if moved is None else (moved, *_wheels_of(folder, moved))


def _wheels_of(folder: Folder, places: Places) -> tuple[Wheels | None, tuple[str, ...]]:
    return wheels_in(folder, places, frozenset(_columns_of(places, details_of(places))))


def _columns_of(places: Places, details: Details) -> Iterator[tuple[str, str]]:
    yield from ((places.file, column) for column, _ in places.columns.values())
    yield from ((places.file, column) for column in details.columns.values())


def _names(places: Places) -> tuple[str, frozenset[str]]:
    return places.file, frozenset(column for column, _ in places.columns.values())


def _beside(what: str, others: Sequence[str]) -> str:
    return f"{what}: others go with the drive as well, and were not taken: {'; '.join(others)}" if others else ""


def _receiver_heading(places: Places, folder: Folder) -> HeadingStream | None:
    if places.table is not None:
        return None
    try:
        heading, _ = read_nmea_heading(folder.path / places.file)
    except DataError:
        return None
    return heading


def _lacks(folder: Folder, what: str, seen: Sequence[str]) -> DataError:
    tables = [f"{one.name} ({', '.join(called(name) for name in list(one.numbers)[:12])})" for one in folder.tables]
    found = "; ".join([*tables, *(f"{path.name} (NMEA)" for path in folder.sentences), *folder.odd])
    known = f"; known: {'; '.join(seen)}" if seen else ""
    return DataError(
        f"{folder.path}: {what}. Looked at: {found or 'nothing that can be read'}{known}; nothing is written"
    )


def _scaled(wheels: Wheels, places: Places) -> Wheels:
    """With metres per unit by legs of the fixes' path, which is what `sccal inspect` goes by too."""
    better = metres_per_count(wheels.t_s, wheels.left_sum, wheels.right_sum, places.stream)
    return wheels if better is None else replace(wheels, m_per_unit=better)


def _track(wheels: Wheels, heading: Heading | HeadingStream) -> tuple[float, tuple[str, ...]]:
    stream = HeadingStream(heading.t_s, heading.yaw_rad) if isinstance(heading, Heading) else heading
    found = track_by_turning_m(wheels.t_s, wheels.left_sum, wheels.right_sum, stream, wheels.m_per_unit)
    if found is None:
        return STAND_IN_TRACK_M, (
            f"the drive turns too little to show the track: {STAND_IN_TRACK_M:g} m stands in for it",
        )
    return float(f"{found:.3g}"), ()


def _sections(
    found: _Found, unit: WheelUnit, folders: Sequence[Path]
) -> tuple[tuple[MappedSection, ...], tuple[str, ...]]:
    """The sections that the contract's own names do not make needless."""
    wheels, places, heading = found.wheels, found.places, found.heading
    sides = zip(("left", "right"), (wheels.left, wheels.right), wheels.reversed, strict=True)
    sections = [
        MappedSection(
            "encoder",
            wheels.table.name,
            {"time": _time(wheels.table), **{side: Column((name,), unit.unit, back) for side, name, back in sides}},
        )
    ]
    if isinstance(heading, Heading):
        key = "heading" if heading.unit else "quaternion"
        columns = {"time": _time(heading.table), key: Column(heading.columns, heading.unit)}
        sections.append(MappedSection("ahrs", heading.table.name, columns))
    sections.append(_fix_section(places, found.details))
    own = [one for one in sections if not _is_contract(one, found.folder)]
    patterned = [_patterned(one, folders) for one in own]
    return tuple(one for one, _ in patterned), tuple(doubt for _, doubt in patterned if doubt)


def _fix_section(places: Places, details: Details) -> MappedSection:
    if places.table is None:
        return MappedSection("gnss", places.file, format=NMEA_FORMAT)
    columns = {"time": _time(places.table)}
    columns |= {key: Column((name,), unit) for key, (name, unit) in places.columns.items()}
    units = {"height": "m", "quality": "", "sigma": "m"}
    columns |= {key: Column((name,), units[key]) for key, name in details.columns.items()}
    return MappedSection("gnss", places.file, columns, places.crs)


def _time(table: Logged) -> Column:
    return Column((table.clock.column,), table.clock.unit)


def _is_contract(section: MappedSection, folder: Folder) -> bool:
    """Whether a file is read in just this way without being mapped."""
    if section.format:
        return section.file.lower() == NMEA_FILE
    name, alternatives = _CONTRACT[section.stream]
    table = next(one for one in folder.tables if one.name == section.file)
    if section.file.lower() != name or any(column.reversed for column in section.columns.values()):
        return False
    if section.stream == "gnss" and any(path.name.lower() == NMEA_FILE for path in folder.sentences):
        return False
    logged = [table.clock.column, *table.numbers, *table.texts]
    theirs = dict(zip(contract_names(logged, alternatives).names, logged, strict=True))
    for key, column in section.columns.items():
        unit = "s" if key == "time" and column.unit == "iso" else column.unit
        ours = _CONTRACT_NAMES.get((key, unit))
        if ours is None or theirs.get(ours) != column.names[0]:
            return False
    return True


def _patterned(section: MappedSection, folders: Sequence[Path]) -> tuple[MappedSection, str]:
    """The file's name, or where other runs have it with other digits, the pattern that means one file in each."""
    if all((folder / section.file).is_file() for folder in folders):
        return section, ""
    pattern = re.sub(r"\d+(?:[-_.:T]?\d+)*", "*", section.file)
    if pattern != section.file and sum(_means_one(folder, pattern) for folder in folders) > 1:
        return replace(section, file=pattern), ""
    return section, f"not every run's folder has a file {shown(section.file)}: the others are not read"


def _means_one(folder: Path, pattern: str) -> bool:
    return len(list(folder.glob(pattern))) == 1


def _reasons(found: _Found, unit: WheelUnit, sections: Sequence[MappedSection], track_m: float) -> tuple[str, ...]:
    wheels, places, heading = found.wheels, found.places, found.heading
    tables = {one.name: one for one in (wheels.table, getattr(heading, "table", None), places.table) if one is not None}
    lines = [f"{name}: {called(one.clock.column)} is the time: it {one.clock.why}" for name, one in tables.items()]
    lines += [f"{places.file}: {why}" for why in (places.why, *found.details.why)]
    lines += [f"{wheels.table.name}: {why}" for why in (*wheels.why, *unit.why)]
    if isinstance(heading, Heading):
        lines += [f"{heading.table.name}: {why}" for why in heading.why]
    else:
        lines.append(f"{places.file}: the receiver's own heading ({heading.source}) is read")
    lines.append(
        f"track {track_m:g} m: on it the wheels turn as far as the heading does (the prior of the calibration)"
    )
    if not sections:
        lines.append("all files have the contract's names and columns: no mapping is needed")
    return tuple(lines)


def _doubts(found: _Found) -> tuple[str, ...]:
    wheels, places, heading = found.wheels, found.places, found.heading
    tables = {one.name: one for one in (wheels.table, getattr(heading, "table", None), places.table) if one is not None}
    clocks = tuple(f"{name}: {one.clock.doubt}" for name, one in tables.items() if one.clock.doubt)
    own = heading.doubts if isinstance(heading, Heading) else ()
    if isinstance(heading, Heading) and not heading.unit_shown:
        own += (
            f"whether {heading.label} is in {heading.unit} is a guess: the path of the fixes turns too little to say",
        )
    if not wheels.course.clear:
        own += ("the path of the fixes turns too little to show which wheel is the left one: the names decide",)
    return (*clocks, *places.doubts, *found.details.doubts, *wheels.doubts, *own, *found.others)


def _checks(unit: WheelUnit, track_unknown: bool) -> dict[str, str]:
    """Remarks behind the lines that hold a number which nobody knows yet."""
    checks = {}
    if unit.doubts and unit.ticks_per_rev is not None:
        checks = {
            "ticks_per_rev": "stands in: see sccal init",
            "wheel_radius_m": "stands in: only both together are known",
        }
    elif unit.doubts:
        checks = {"wheel_radius_m": "to be checked with the tape measure"}
    return checks | ({"track_m": "stands in: to be measured"} if track_unknown else {})


def _refusal(text: str, folder: Path) -> str:
    """What reading and aligning the run by this text would refuse."""
    with tempfile.TemporaryDirectory() as place:
        vehicle = Path(place) / VEHICLE_FILE
        write_text(vehicle, text)
        try:
            align(read_run(RunSource(folder.name, folder, vehicle, folder)))
        except DataError as error:
            return str(error).replace(str(vehicle), VEHICLE_FILE)
    return ""


def _of_other_runs(text: str, main: Path, folders: Sequence[Path]) -> tuple[str, ...]:
    """Runs that have files of the mapping and not all of them."""
    lacking = []
    with tempfile.TemporaryDirectory() as place:
        vehicle = Path(place) / VEHICLE_FILE
        write_text(vehicle, text)
        mapping = read_mapping(vehicle)
        for folder in folders:
            try:
                if folder != main:
                    listed_folder(folder, mapping).require_all()
            except DataError as error:
                lacking.append(str(error))
    return tuple(lacking[:4])
