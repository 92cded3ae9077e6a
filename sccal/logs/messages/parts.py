"""The files of one drive that its recorder split: which follow which, told by their recorder and not by guessing.

rosbag2 lists the files of a bag in a page beside them; rosbag names the parts of one record PREFIX_DATE_0,
PREFIX_DATE_1 and so on. Files that are only numbered may be different drives, and stay runs of their own.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from sccal.logs.formats import MCAP, ROS1
from sccal.logs.names import BAG_FILE

_LISTED = re.compile(rf"^\s*-\s*['\"]?([^'\"\n]+{re.escape(MCAP.suffix)})['\"]?\s*$", re.MULTILINE | re.IGNORECASE)
_SPLIT = re.compile(
    rf"(?P<prefix>.*_|)(?P<date>\d{{4}}(?:-\d\d){{5}})_(?P<number>\d+){re.escape(ROS1.suffix)}", re.IGNORECASE
)
_LARGEST_PAGE = 1 << 22


def parts_after(path: Path) -> tuple[Path, ...]:
    """The files that continue the drive which begins in a file; none where it is whole, or itself a later part."""
    for drive in _drives_in(path.parent, path.suffix.lower()):
        if drive[0] == path.name:
            return tuple(path.parent / name for name in drive[1:])
    return ()


def later_parts(folder: Path, names: Iterable[str]) -> set[str]:
    """Which of a folder's files continue another one's drive."""
    suffixes = {Path(name).suffix.lower() for name in names}
    return {name for suffix in suffixes for drive in _drives_in(folder, suffix) for name in drive[1:]}


def _drives_in(folder: Path, suffix: str) -> list[list[str]]:
    """The names of each drive's files in a folder, in order."""
    if suffix == MCAP.suffix:
        return [drive for drive in (_listed_in(folder),) if drive]
    return _split_in(folder) if suffix == ROS1.suffix else []


def _listed_in(folder: Path) -> list[str]:
    page = folder / BAG_FILE
    try:
        if page.stat().st_size > _LARGEST_PAGE:
            return []
        text = page.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return []
    names = dict.fromkeys(Path(name.strip()).name for name in _LISTED.findall(text))
    return [name for name in names if (folder / name).is_file()]


def _split_in(folder: Path) -> list[list[str]]:
    matches = [match for entry in folder.iterdir() if (match := _SPLIT.fullmatch(entry.name)) and entry.is_file()]
    drives: list[list[str]] = []
    last: tuple[str, int] | None = None
    for match in sorted(matches, key=lambda one: (one["prefix"], one["date"], int(one["number"]))):
        prefix, number = match["prefix"], int(match["number"])
        if last == (prefix, number - 1):
            drives[-1].append(match[0])
        else:
            drives.append([match[0]])
        last = prefix, number
    return drives
