"""What stands beside the places in a table of fixes: quality, height and sigma, by name and by what is possible."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sccal.logs.limits import HEIGHT_LIMIT_M
from sccal.logs.mapping import LOCAL
from sccal.logs.quality_words import qualities_of_words
from sccal.propose import words
from sccal.propose.places import Places
from sccal.propose.tables import Logged

_MOST_CODE = 80
"""NovAtel's position types end below it; GGA's qualities below ten."""
_LARGEST_SIGMA_M = 10.0
"""Larger numbers may be millimetres as well, and a wrong sigma is worse than none."""


@dataclass(frozen=True)
class Details:
    """Columns by the mapping's key, and why."""

    columns: dict[str, str]
    why: tuple[str, ...]
    doubts: tuple[str, ...]


def details_of(places: Places) -> Details:
    """What is found beside the places; nothing for sentences, which say it themselves."""
    table = places.table
    if table is None:
        return Details({}, (), ())
    used = {column for column, _ in places.columns.values()}
    names = [name for name in (*table.numbers, *table.texts) if name not in used]
    columns, why, doubts = {}, [], []
    quality = next((name for name in names if words.has(name, words.QUALITY) and _is_quality(table, name)), None)
    if quality is not None:
        columns["quality"] = quality
        why.append(
            f"{words.called(quality)} is the fixes' quality, read in GGA's codes (4 RTK fixed, 5 float, 1 autonomous)"
        )
    height = next((name for name in names if _is_called_height(places, name) and _is_height(table, name)), None)
    if height is not None and places.crs != LOCAL and height != quality:
        columns["height"] = height
        why.append(f"{words.called(height)} is the height in metres")
    sigma = next((name for name in names if words.has(name, words.SIGMA) and name not in columns.values()), None)
    if sigma is not None and sigma in table.numbers:
        middle = float(np.nanmedian(table.numbers[sigma]))
        if 0.0 < middle < _LARGEST_SIGMA_M:
            columns["sigma"] = sigma
            why.append(f"{words.called(sigma)} is the fixes' sigma in metres: {middle:.3g} usually")
        elif middle > 0.0:
            doubts.append(
                f"{words.called(sigma)} may be the fixes' sigma, and {middle:.3g} is too large for metres: left out"
            )
    return Details(columns, tuple(why), tuple(doubts))


def _is_quality(table: Logged, name: str) -> bool:
    if name in table.texts:
        return qualities_of_words(sorted(set(table.texts[name]))) is not None
    known = table.numbers[name][np.isfinite(table.numbers[name])]
    return bool(known.size and (known == np.round(known)).all() and known.min() >= 0 and known.max() <= _MOST_CODE)


def _is_called_height(places: Places, name: str) -> bool:
    """By a word for it, or as the third of x, y and z."""
    if words.has(name, words.HEIGHT):
        return True
    east = places.columns.get("east")
    return (
        east is not None
        and words.has(name, words.UP)
        and (words.without(name, words.UP) == words.without(east[0], words.EAST))
    )


def _is_height(table: Logged, name: str) -> bool:
    if name not in table.numbers:
        return False
    known = table.numbers[name][np.isfinite(table.numbers[name])]
    return bool(known.size and np.abs(known).max() < HEIGHT_LIMIT_M / 10.0 and np.ptp(known) > 0.0)
