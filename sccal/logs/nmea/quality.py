"""The quality that a fix states, in the numbers of GGA, out of sentences of any kind that holds a position."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sccal.arrays import Ints
from sccal.logs.decimals import Bytes
from sccal.logs.nmea.kinds import NO_FIX, NOT_STATED, Claim, Position
from sccal.logs.nmea.sentences import Sentences

_CONSTELLATIONS = 8


def stated_quality(own: Sentences, position: Position) -> Ints:
    """The quality (n,) that sentences of one kind state; 0 no fix, -1 not stated."""
    field, claim = position.quality, position.claim
    if claim.form == "number":
        quality = _numbered(own, field, claim)
    elif claim.form == "word":
        quality = worded(own, field, claim.read, claim.others)
    else:
        letters = own.letter(field)[:, None] if claim.form == "letter" else own.letters(field, _CONSTELLATIONS)
        quality = _best(letters, claim.read)
    if position.status is not None:
        holds = worded(own, position.status, dict.fromkeys(position.holds, 1), 0)
        quality = np.where(holds == 1, quality, NO_FIX)
    return quality


def _numbered(own: Sentences, field: int, claim: Claim) -> Ints:
    code = own.number(field)
    by_code = np.array([claim.read[str(code)] for code in range(len(claim.read))])
    known = (code >= 0) & (code < by_code.size) & (code == np.floor(code))
    return np.where(
        known, by_code[np.where(known, code, 0).astype(np.int64)], np.where(code > 0, claim.unknown, NO_FIX)
    )


def _best(letters: Bytes, read: Mapping[str, int]) -> Ints:
    """The quality of the best of some letters (n, k)."""
    rank = np.full(256, -1, dtype=np.int64)
    rank[[ord(letter) for letter in read]] = np.arange(len(read))
    best = np.max(rank[letters], axis=1, initial=-1)
    stated: Ints = np.array([*read.values(), NOT_STATED], dtype=np.int64)[best]
    return stated


def worded(own: Sentences, field: int, read: Mapping[str, int], others: int = NOT_STATED) -> Ints:
    """What each text in field ``field`` stands for (n,); ``others`` for any other."""
    begin, end = own.span(field)
    quality = np.full(begin.size, others, dtype=np.int64)
    for word, code in read.items():
        same = own.letters(field, len(word)) == np.frombuffer(word.encode(), dtype=np.uint8)
        quality[same.all(axis=1) & (end - begin == len(word))] = code
    return quality
