"""Qualities of fixes in other words and numbers than GGA's, known by themselves: words, and NovAtel's position types.

Numbers that could be GGA's are taken as GGA's; whether they are, only the scatter of the fixes can tell. Sources:
NovAtel OEM7 documentation, BESTPOS, position or velocity type; RTKLIB manual, solution file (Q: 1 fix, 2 float, 3 SBAS,
4 DGPS, 5 single, 6 PPP).
"""

from __future__ import annotations

import re

import numpy as np

from sccal.arrays import Floats

RTKLIB = {1: 4, 2: 5, 3: 9, 4: 2, 5: 1, 6: 5}
"""A column called Q is RTKLIB's."""
_NOVATEL = {
    **{0: 0, 1: 7, 2: 7, 8: -1, 16: 1, 17: 2, 18: 9, 19: 6, 32: 5, 33: 5, 34: 5, 48: 4, 49: 4, 50: 4, 51: -1, 52: 9},
    **{53: 1, 54: 2, 55: 5, 56: 4, 68: 5, 69: 5, 73: 5, 74: 5, 77: 5, 78: 5},
}
_WORDS = (
    (4, r"(ins)?rtk(fix(ed)?|int)?|(narrow|wide|l1)int|(rtk)?fixed|integer|r|phase|carrierfixed"),
    (5, r"(ins)?rtkfloat|(narrow|wide|l1|ionofree)?float|f|carrierfloat"),
    (2, r"d?gps?diff|dgps|dgnss|psrdiff|inspsrdiff|differential|d"),
    (9, r"sbas|waas|egnos"),
    (1, r"single|autonomous|stand_?alone|spp|inspsrsp|gpsspp|[23]d(fix)?|a|gps|gnss"),
    (6, r"dr|dead_?reckoning|estimated|propagated|e"),
    (0, r"none|nofix|invalid|n|no|void|v"),
)
_FIX_WITH_OTHERS = (1, 5)


def qualities_of_words(words: list[str]) -> dict[str, int] | None:
    """GGA's quality of each of some words; None where one of them is not known.

    ``fix`` alone may be any fix, and is a fixed one where floats or single ones stand beside it.
    """
    found: dict[str, int] = {}
    for word in words:
        plain = re.sub(r"[^a-z0-9]", "", word.lower())
        code = next((code for code, pattern in _WORDS if re.fullmatch(pattern, plain)), None)
        if code is None and plain != "fix":
            return None
        found[word] = -1 if code is None else code
    if any(code in _FIX_WITH_OTHERS for code in found.values()):
        found = {word: 4 if code == -1 else code for word, code in found.items()}
    return found


def of_novatel(codes: Floats) -> Floats | None:
    """GGA's qualities for position types (n); None where the numbers are not all such, or could be GGA's."""
    known = codes[np.isfinite(codes)]
    if known.size == 0 or known.max() <= 9 or not np.isin(known, list(_NOVATEL)).all():
        return None
    return mapped(codes, _NOVATEL)


def mapped(codes: Floats, meaning: dict[int, int]) -> Floats:
    """What each code (n) means; -1 for those without a meaning, NaN where there is none."""
    out = np.where(np.isfinite(codes), -1.0, np.nan)
    for code, quality in meaning.items():
        out[codes == code] = quality
    return out
