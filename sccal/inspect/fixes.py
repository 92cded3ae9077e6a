"""What the receiver says about its fixes: quality over time, stated sigmas, satellites, age of the corrections."""

from __future__ import annotations

import numpy as np

from sccal.align.accuracy import QUALITY_NAMES
from sccal.arrays import Floats
from sccal.inspect.coverage import longest_step_s
from sccal.inspect.place import PlacedFixes
from sccal.logs.streams import FixStream
from sccal.results.inspection import FixFacts, QualityShare, QualitySpan, Range

STRIP_CELLS = 60
FINE_CELLS = 480


def fix_facts(stream: FixStream, placed: PlacedFixes, span_s: tuple[float, float]) -> FixFacts:
    """Of the fixes that have a time and a position."""
    codes, counts = np.unique(placed.quality, return_counts=True)
    limit = longest_step_s(placed.t_s)
    usual = float(np.median(np.diff(placed.t_s))) if placed.t_s.size > 1 else 0.0
    steps = np.diff(placed.t_s, append=placed.t_s[-1:] + usual)
    lasts = np.where(steps > limit, usual, steps)
    shares = [
        QualityShare(
            int(code), QUALITY_NAMES.get(int(code), "unknown"), int(n), float(lasts[placed.quality == code].sum())
        )
        for code, n in zip(codes, counts, strict=True)
    ]
    sigma = np.sqrt(0.5 * (stream.sigma_east_m**2 + stream.sigma_north_m**2))[placed.row]
    return FixFacts(
        qualities=tuple(sorted(shares, key=lambda one: -one.count)),
        spans=_spans(placed, limit, usual),
        strip=_strip(placed, span_s, usual, STRIP_CELLS),
        fine_strip=_strip(placed, span_s, usual, FINE_CELLS),
        stated_sigma_m=range_of(sigma),
        stated_share=float(np.isfinite(sigma).mean()) if sigma.size else 0.0,
        satellites=_column(stream, placed, "satellites"),
        hdop=_column(stream, placed, "hdop"),
        age_s=_column(stream, placed, "age_s"),
        white_m=placed.white_m,
    )


def range_of(values: Floats) -> Range | None:
    """Of the finite ones; None where there is none."""
    finite = values[np.isfinite(values)]
    return Range(float(finite.min()), float(np.median(finite)), float(finite.max())) if finite.size else None


def _column(stream: FixStream, placed: PlacedFixes, name: str) -> Range | None:
    column = stream.extras.get(name)
    return None if column is None else range_of(column[placed.row])


def _spans(placed: PlacedFixes, limit_s: float, usual_s: float) -> tuple[QualitySpan, ...]:
    """Stretches of one quality, and the gaps between them."""
    if placed.t_s.size == 0:
        return ()
    changes = np.flatnonzero((np.diff(placed.quality) != 0) | (np.diff(placed.t_s) > limit_s)) + 1
    starts = np.concatenate(([0], changes))
    ends = np.concatenate((changes, [placed.t_s.size]))
    spans: list[QualitySpan] = []
    for a, b in zip(starts.tolist(), ends.tolist(), strict=True):
        begin, code = float(placed.t_s[a]), int(placed.quality[a])
        if spans and begin - spans[-1].end_s > limit_s:
            spans.append(QualitySpan(spans[-1].end_s, begin, None))
        follows = b < placed.t_s.size and placed.t_s[b] - placed.t_s[b - 1] <= limit_s
        spans.append(QualitySpan(begin, float(placed.t_s[b]) if follows else float(placed.t_s[b - 1]) + usual_s, code))
    return tuple(spans)


def _strip(placed: PlacedFixes, span_s: tuple[float, float], usual_s: float, cells: int) -> tuple[int | None, ...]:
    """The most frequent quality of each cell; a cell shorter than a step of the fixes takes the fix before it."""
    first, last = span_s
    if placed.t_s.size == 0 or last <= first:
        return ()
    if placed.t_s[-1] < first or placed.t_s[0] > last:
        first, last = float(placed.t_s[0]), float(placed.t_s[-1])
    width = max(last - first, 1e-9) / cells
    cell = np.floor((placed.t_s - first) / width).astype(np.int64).clip(0, cells - 1)
    strip: list[int | None] = []
    # The fixes are in order of time, so each cell's stand together.
    bounds = np.searchsorted(cell, np.arange(cells + 1))
    for k in range(cells):
        own = placed.quality[bounds[k] : bounds[k + 1]]
        if own.size:
            codes, counts = np.unique(own, return_counts=True)
            strip.append(int(codes[int(np.argmax(counts))]))
            continue
        before = int(np.searchsorted(placed.t_s, first + k * width)) - 1
        fresh = before >= 0 and first + k * width - placed.t_s[before] < 1.5 * usual_s
        strip.append(int(placed.quality[before]) if fresh else None)
    return tuple(strip)
