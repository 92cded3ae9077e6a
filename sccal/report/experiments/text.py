"""The paper's experiments in words and numbers: what the terminal shows, and what the page shares with it.

First whether estimating the offset helps and whether the parameters come out, then one line per drive and fault.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sccal.experiments.magnetometer import WANDER_DEG, WANDER_TIME_S
from sccal.experiments.plan import FIXES_FIRST_S, LOSS
from sccal.report.layout import in_columns, labelled, shortened, wrapped
from sccal.results.experiments import TOLERANCE_PERCENT, Cell, Experiment, Experiments, Spread
from sccal.results.numbers import duration, one_line, plain, short

WITHIN = f"within {TOLERANCE_PERCENT:g} %"
FAILED_SHOWN = 8
NARROWEST_NAME = 10
LONGEST_NAME = 40
_INDENT = "  "
_COLUMNS = ("without m", "with m", "end without", "end with", "ratio", WITHIN)


@dataclass(frozen=True)
class Line:
    """One drive under one fault, as the tables show it."""

    cell: Cell
    name: str
    rms_without: str
    rms_with: str
    end_without: str
    end_with: str
    ratio: str
    within: str
    """``19/20`` seeds; empty where no truth is known."""


def experiments_text(e: Experiments, width: int = 100) -> str:
    """The answer, the table, what limits it, and what is ours and not the paper's."""
    lines = [line for text in answers(e) for line in wrapped(text, width)]
    lines += ["", *wrapped(f"{setting(e)} {reading()}", width), ""]
    lines += [*_table(e, width), ""]
    lines += labelled("beyond", whys(e), width)
    failed = [f"{shortened(one_line(failure.name), LONGEST_NAME)}: {failure.reason}" for failure in e.failed]
    rest = [f"… and {len(failed) - FAILED_SHOWN} more in experiments.json"] if len(failed) > FAILED_SHOWN else []
    lines += labelled("failed", [*failed[:FAILED_SHOWN], *rest], width)
    lines += labelled("ours", [ours(e)], width)
    return "\n".join(lines) + "\n"


def answers(e: Experiments) -> list[str]:
    """Whether the offset state helps, by which ratio, and whether the parameters come out: simulated, then measured."""
    texts = []
    for measured in (False, True):
        cells = [cell for cell in e.cells if cell.measured == measured]
        if cells:
            texts += [_beats(cells, measured), *_true_enough(cells, measured)]
    return texts or ["Nothing was tried that gave a result."]


def headline(e: Experiments) -> str:
    """In a few words."""
    better = sum(cell.ratio.median > 1.0 for cell in e.cells)
    if not e.cells:
        return "no result"
    return f"estimating the heading offset gave the smaller position error in {_share(better, len(e.cells))} cells"


def setting(e: Experiments) -> str:
    """What was driven, in one sentence."""
    seeds = f"{len(e.seeds)} seed{'' if len(e.seeds) == 1 else 's'}"
    return f"Simulated drives of {duration(e.duration_s)}, {seeds} each."


def reading() -> str:
    """What the table's numbers are."""
    return (
        "Position error of the forward filter while the fault lasts, without and with offset estimation: rms and at "
        "the end, median (5–95 %) over the seeds; ratio of the rms errors: geometric mean (95 % interval)."
    )


def lines_of(e: Experiments) -> list[tuple[Experiment, list[Line]]]:
    """The table: for each fault its drives."""
    faults = list(dict.fromkeys(cell.experiment for cell in e.cells))
    return [(fault, [_line(cell) for cell in e.cells if cell.experiment == fault]) for fault in faults]


def whys(e: Experiments) -> list[str]:
    """For each cell whose parameters miss the tolerance, why."""
    return [f"{cell_name(cell)}: {cell.why_not}" for cell in e.cells if cell.why_not]


def cell_name(cell: Cell) -> str:
    """``circle, fixes lost``."""
    return f"{drive_name(cell)}, {cell.experiment.title}"


def drive_name(cell: Cell) -> str:
    """The path, or the measured run."""
    return shortened(one_line(cell.path), LONGEST_NAME)


def whole_offset_deg(e: Experiments) -> float | None:
    """The heading offset of the simulated robot; None where no drive was simulated."""
    return next((cell.truth[3] for cell in e.cells if not cell.measured and cell.truth is not None), None)


def fault_clause(experiment: Experiment) -> str:
    """What happens to the fixes, and when."""
    if experiment.is_loss:
        begin, end = (f"{100.0 * share:g}" for share in LOSS)
        return f"no fix from {begin} to {end} % of the run: wheels and heading alone carry the position"
    return (
        f"after {FIXES_FIRST_S:g} s of good fixes, or a fifth of a shorter run, every fix is displaced by white noise "
        f"of σ = {experiment.sigma_m:g} m east and north and claims quality {experiment.quality}"
    )


def ours(e: Experiments) -> str:
    """What the paper does not say and was chosen here, in one paragraph."""
    offset = whole_offset_deg(e)
    whole = (
        ""
        if offset is None
        else f" The variant without keeps the whole offset of {short(offset)} deg, mounting plus declination, which is "
        "what the paper's SC EKF faces if nobody subtracts it: that is why the ratios are large."
    )
    return (
        "The paper shows these experiments as figures without printing the numbers. The drives' kinds and the levels "
        "of noise are the paper's; when a fault begins and how long it lasts, the drives' sizes, the wander of the "
        f"magnetometer's offset (σ {WANDER_DEG:g} deg, correlated over {WANDER_TIME_S:g} s), the noise estimation and "
        f"all numbers here are ours.{whole}"
    )


def metres(value: float) -> str:
    """Two digits, three from ten metres on."""
    return plain(value, 3 if abs(value) >= 10.0 else 2)


def spread_text(spread: Spread) -> str:
    """``0.54 (0.33–0.75)``; the median alone where there is no range."""
    if not _ranges(spread):
        return metres(spread.median)
    return f"{metres(spread.median)} ({metres(spread.low)}–{metres(spread.high)})"


def ratio_text(spread: Spread) -> str:
    """``4.5 (2.4–8.4)``; the mean alone where one seed gives no interval."""
    if not _ranges(spread):
        return _factor(spread.median)
    return f"{_factor(spread.median)} ({_factor(spread.low)}–{_factor(spread.high)})"


def _ranges(spread: Spread) -> bool:
    return math.isfinite(spread.low) and math.isfinite(spread.high) and spread.low < spread.high


def _factor(value: float) -> str:
    if value > 9999.0:
        return ">9999"
    return "<0.01" if 0.0 <= value < 0.01 else plain(value, 2)


def _beats(cells: Sequence[Cell], measured: bool) -> str:
    better = sum(cell.ratio.median > 1.0 for cell in cells)
    of_kind = "with measured runs" if measured else "with simulated drives"
    text = f"Offset estimation beats none in {_share(better, len(cells))} cells {of_kind}"
    least, most = (choose(cells, key=lambda cell: cell.ratio.median).ratio for choose in (min, max))
    by = ratio_text(least) if most is least else f"{ratio_text(least)} to {ratio_text(most)}"
    text += f": without it the rms position error is {by} times as large"
    known = [cell for cell in cells if math.isfinite(cell.ratio.low)]
    if known:
        above = sum(cell.ratio.low > 1.0 for cell in known)
        text += f"; the 95 % interval of that ratio lies above 1 in {_share(above, len(known))}"
        text += "" if len(known) == len(cells) else " that have one"
    worse = [cell_name(cell) for cell in cells if not cell.ratio.median > 1.0]
    return f"{text}; not better: {' and '.join(worse)}." if worse else f"{text}."


def _true_enough(cells: Sequence[Cell], measured: bool) -> list[str]:
    judged = [cell for cell in cells if cell.truth is not None]
    if not judged:
        return []
    good, count = sum(cell.within_percent for cell in judged), sum(len(cell.seeds) for cell in judged)
    truth = "what the undisturbed run gives" if measured else "the truth"
    text = f"With it both radii and the track end {WITHIN} of {truth} in {_share(good, count)} trials"
    names = list(dict.fromkeys(drive_name(cell) for cell in judged if cell.why_not))
    return [f"{text}; the others are of {' and '.join(names)}." if names else f"{text}."]


def _share(some: int, count: int) -> str:
    return f"all {count}" if some == count > 1 else f"{some} of {count}"


def _line(cell: Cell) -> Line:
    without, with_offset = cell.figures["without"], cell.figures["with"]
    return Line(
        cell=cell,
        name=drive_name(cell),
        rms_without=spread_text(without.rms_spread_m),
        rms_with=spread_text(with_offset.rms_spread_m),
        end_without=metres(without.end_spread_m.median),
        end_with=metres(with_offset.end_spread_m.median),
        ratio=ratio_text(cell.ratio),
        within="" if cell.truth is None else f"{cell.within_percent}/{len(cell.seeds)}",
    )


def _table(e: Experiments, width: int) -> list[str]:
    """One line per drive below its fault; on a narrow terminal first the ranges of the larger error go, then more."""
    groups = lines_of(e)
    every = [line for _, lines in groups for line in lines]
    if not every:
        return []
    full = [(x.rms_without, x.rms_with, x.end_without, x.end_with, x.ratio, x.within or "-") for x in every]
    brief = [(_median(a), b, *rest) for a, b, *rest in full]
    briefer = [(_median(a), _median(b), *rest) for a, b, *rest in full]
    for table, shown in ((full, _ALL), (brief, _ALL), (brief, _NO_ENDS), (briefer, _NO_ENDS), (briefer, _RATIO_ONLY)):
        cells = [tuple(row[k] for k in shown) for row in (_COLUMNS, *table)]
        room = width - sum(2 + max(map(len, column)) for column in zip(*cells, strict=True)) - len(_INDENT)
        if room >= NARROWEST_NAME:
            break
    names = [shortened(x.name, max(room, NARROWEST_NAME)) for x in every]
    rows = [(f"{_INDENT}{name}", *cell) for name, cell in zip(("drive", *names), cells, strict=True)]
    head, *body = in_columns(rows, "<" + ">" * len(shown))
    lines = [head]
    for fault, of_fault in groups:
        lines += [*wrapped(fault.title, width), *body[: len(of_fault)]]
        body = body[len(of_fault) :]
    return lines


_ALL, _NO_ENDS, _RATIO_ONLY = (0, 1, 2, 3, 4, 5), (0, 1, 4, 5), (4, 5)


def _median(text: str) -> str:
    return text.partition(" ")[0]
