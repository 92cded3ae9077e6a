"""NMEA logs with a fault, from bytes to bytes: only positions and what the sentences claim of them change.

Work goes by pieces of whole lines, twice: once to collect the epochs (``epochs``), once to write (``rewriting``).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.degrade.epochs import Epochs, Holders, find_holders, gathered, zda_days
from sccal.degrade.faults import FaultedFixes, Faults, fault_fixes, filled_times, on_the_day
from sccal.degrade.rewriting import Plan, rewritten_piece
from sccal.errors import DataError
from sccal.logs.nmea.kinds import LAYOUTS, PLACED, Kind
from sccal.logs.nmea.received import with_receive_times
from sccal.logs.nmea.sentences import Sentences, find_sentences, formatters, kinds_in
from sccal.logs.reference import ReferenceRows
from sccal.logs.text import as_utf8

_PIECE_BYTES = 1 << 20
_THREADS = 2
_HEX_SAMPLE_BYTES = 1 << 20


@dataclass(frozen=True)
class DegradedNmea:
    """A rewritten log and what was done."""

    raw: bytes
    epochs: Epochs
    t_s: Floats
    """Of each epoch, on the clock of the windows."""
    fixes: FaultedFixes
    """What became of each epoch."""
    rewritten: Counter[str]
    """Sentences by kind; with ``drop``, those left out too."""
    left: Counter[str]
    """Sentences by kind that stayed as they were."""

    @property
    def outliers(self) -> int:
        """How many of the fixes that are read jump."""
        return int(self.fixes.outlier[self.epochs.read].sum())

    def reference(self) -> ReferenceRows:
        """The fixes that are read, as they were, and what became of them."""
        epochs, fixes, read = self.epochs, self.fixes, self.epochs.read
        dated = np.isfinite(epochs.utc_s).all()
        return ReferenceRows(
            t_s=epochs.host_t_s[read],
            utc_s=(epochs.utc_s if dated else epochs.epoch_s)[read],
            lat_deg=epochs.lat_deg[read],
            lon_deg=epochs.lon_deg[read],
            quality=epochs.quality[read],
            lost=fixes.lost[read],
            displaced=fixes.displaced[read],
        )


def degrade_nmea(raw: bytes, faults: Faults, span_s: tuple[float, float] | None, stream_name: str) -> DegradedNmea:
    """Rewrite a log's bytes; ``span_s`` is the run's, on its own clock; None to take that of the fixes.

    Raises:
        DataError: no position in the log, or windows on a clock that its times do not share.
        UsageError: a window outside the run.
    """
    raw = as_utf8(raw)
    pieces = list(_pieces(raw))
    with ThreadPoolExecutor(_THREADS) as pool:
        collected = list(pool.map(lambda piece: _collected(raw[piece[0] : piece[1]]), pieces))
    seen = sum((counts for _, _, counts in collected), Counter[str]())
    holders = [one for one, _, _ in collected]
    epochs, epoch_of = gathered(holders, [zda for _, zda, _ in collected])
    if not epochs.read.any():
        raise DataError(f"no position fix in {sum(seen.values())} sentences: nothing to degrade")
    t_s = _window_times(epochs, faults, span_s)
    if span_s is None:
        span_s = float(np.nanmin(t_s)), float(np.nanmax(t_s))
    fixes = fault_fixes(
        t_s,
        epochs.lat_deg,
        epochs.lon_deg,
        epochs.quality,
        faults,
        span_s,
        stream_name,
        epochs.epoch_s,
        epochs.read,
    )
    plan = Plan(faults, epochs, fixes, _small_hex(raw))
    ends = np.cumsum([one.row.size for one in holders])

    def written(number: int) -> tuple[bytes, Counter[str]]:
        piece, own = raw[slice(*pieces[number])], holders[number]
        if own.row.size == 0 and not faults.gst:
            return piece, Counter()
        return rewritten_piece(
            _found(piece), len(piece), own, epoch_of[ends[number] - own.row.size : ends[number]], plan
        )

    with ThreadPoolExecutor(_THREADS) as pool:
        results = list(pool.map(written, range(len(pieces))))
    rewritten = sum((counts for _, counts in results), Counter[str]())
    return DegradedNmea(b"".join(new for new, _ in results), epochs, t_s, fixes, rewritten, seen - rewritten)


def _collected(piece: bytes) -> tuple[Holders, tuple[Floats, Floats], Counter[str]]:
    found = _found(piece)
    return find_holders(found), zda_days(found), _kinds(found)


def _found(piece: bytes) -> Sentences:
    return with_receive_times(find_sentences(piece), "", [])


def _pieces(raw: bytes) -> Iterator[tuple[int, int]]:
    """Stretches of whole lines."""
    mark = b"\n" if b"\n" in raw else b"\r"
    first = 0
    while first < len(raw):
        last = raw.find(mark, first + _PIECE_BYTES) + 1 or len(raw)
        yield first, last
        first = last


def _kinds(found: Sentences) -> Counter[str]:
    """How many sentences of each kind there are; those with a wrong checksum apart."""
    wrong = found.has_checksum & ~found.right_checksum
    counts: Counter[str] = Counter()
    placed = kinds_in(found.kind, PLACED)
    kinds, numbers = np.unique(found.kind[placed & ~wrong], return_counts=True)
    for kind, number in zip(kinds.tolist(), numbers.tolist(), strict=True):
        counts[LAYOUTS[Kind(kind)].name] += number
    names, numbers = np.unique(formatters(found)[~placed & ~wrong], return_counts=True)
    for name, number in zip(names.tolist(), numbers.tolist(), strict=True):
        counts[name.decode("ascii") or "other"] += number
    if wrong.any():
        counts["wrong checksum"] += int(wrong.sum())
    return counts


def _window_times(epochs: Epochs, faults: Faults, span_s: tuple[float, float] | None) -> Floats:
    """Times of the epochs on the run's clock: receive times where the log has them, else UTC."""
    dated = np.isfinite(epochs.utc_s).all()
    if np.isfinite(epochs.host_t_s).any():
        return filled_times(epochs.host_t_s, epochs.epoch_s)
    if span_s is None:
        return epochs.utc_s if dated else epochs.epoch_s
    t_s = epochs.utc_s if dated else on_the_day(epochs.epoch_s, span_s)
    windows = bool(faults.losses_s) or faults.from_s is not None
    if windows and (t_s[0] > span_s[1] or t_s[-1] < span_s[0]):
        raise DataError(
            f"the sentences have no receive time, and their UTC times ({t_s[0]:.3f} s to {t_s[-1]:.3f} s as Unix time) "
            f"do not meet the encoder's (t = {span_s[0]:.3f} s to {span_s[1]:.3f} s), so no window can be placed; "
            "log t as Unix time, or a receive time before each sentence"
        )
    return t_s


def _small_hex(raw: bytes) -> bool:
    """Whether the log writes its checksums in small letters."""
    sample = raw[:_HEX_SAMPLE_BYTES]
    small = re.search(rb"\*(?:[0-9][a-f]|[a-f][0-9a-f])\s", sample)
    return small is not None and re.search(rb"\*(?:[0-9][A-F]|[A-F][0-9A-F])\s", sample) is None
