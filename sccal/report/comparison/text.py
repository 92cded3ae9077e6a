"""Two results side by side on the terminal: what changed first, then every parameter, then the figures."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sccal.report.layout import in_columns, labelled, wrapped
from sccal.results.calibration import Estimate
from sccal.results.comparison import Comparison, Figure, FoundEffect, Pair, Side
from sccal.results.differences import unit_of
from sccal.results.numbers import one_line, plain, short, value_and_sigma

LABELS = {
    "parameters.radius_right_m": "right radius mm",
    "parameters.radius_left_m": "left radius mm",
    "parameters.track_m": "track mm",
    "parameters.heading_offset_deg": "offset deg",
}
NONE = "-"


def compare_text(c: Comparison, width: int = 100) -> str:
    """The whole comparison in about 30 lines of at most ``width`` columns, names of effects allowing."""
    lines = [
        *wrapped(headline(c), width),
        "",
        *_side("A", c.a, width),
        *_side("B", c.b, width),
        "",
        *[line for remark in c.remarks for line in wrapped(f"note: {remark}", width)],
        *([""] if c.remarks else []),
        *_effects(c.effects, width),
        *_pairs(c.pairs, width),
        *_figures(c.figures),
    ]
    return "\n".join(lines) + "\n"


def headline(c: Comparison) -> str:
    """What changed, in one sentence."""
    of_effects = [f"{effect.effect} {effect.change}" for effect in c.effects if effect.change != "kept"]
    of_pairs = [_label(pair.name) for pair in c.pairs if pair.change == "changed"]
    compared = sum(pair.change != "not comparable" for pair in c.pairs)
    if compared:
        beyond = f"{len(of_pairs)} of {compared} parameters changed by more than {short(c.sigmas)} sigma"
    else:
        beyond = "no parameter could be compared"
    named = f": {', '.join(_without_unit(pair) for pair in of_pairs)}" if of_pairs else ""
    findings = f"findings: {', '.join(of_effects)}" if of_effects else "the same findings"
    return one_line(f"{findings}; {beyond}{named}" if c.kind == "diagnosis" else f"{beyond}{named}")


def _side(letter: str, side: Side, width: int) -> list[str]:
    verdict = f": {side.verdict}" if side.verdict else ""
    return labelled(letter, [f"{side.what} ({side.path}){verdict}"], width)


def _effects(effects: Sequence[FoundEffect], width: int) -> list[str]:
    if not effects:
        return []
    header = ("effect", "nats A", "nats B", "")
    rows = [(one_line(effect.effect), _nats(effect.nats_a), _nats(effect.nats_b), effect.change) for effect in effects]
    lines = in_columns([header, *rows], "<>><")
    for one in effects:
        if one.reason:
            lines += wrapped(f"{one.effect}: {one.reason}", width, "  ")
    return [*lines, ""]


def _pairs(pairs: Sequence[Pair], width: int) -> list[str]:
    header = ("parameter", "A", "B", "B - A", "sigmas", "")
    rows = [
        (
            _label(pair.name),
            _estimate(pair.a, _scale(pair.name)),
            _estimate(pair.b, _scale(pair.name)),
            _difference(pair),
            NONE if pair.difference is None else _sigmas(pair.difference.in_sigmas),
            NONE if pair.difference is None else pair.change,
        )
        for pair in pairs
    ]
    lines = in_columns([header, *rows], "<>>>><") if rows else []
    for one in pairs:
        if one.reason:
            lines += wrapped(f"{_without_unit(_label(one.name))}: {one.reason}", width, "  ")
    return [*lines, ""] if lines else []


def _figures(figures: Sequence[Figure]) -> list[str]:
    told = [figure for figure in figures if figure.a is not None or figure.b is not None]
    rows = [(figure.name, plain(figure.a), plain(figure.b), _ratio(figure)) for figure in told]
    return in_columns([("figure", "A", "B", "B / A"), *rows], "<>>>") if rows else []


def _label(name: str) -> str:
    if name in LABELS:
        return LABELS[name]
    key = name.rpartition(".")[2]
    unit = unit_of(key)
    return one_line(name.partition(".")[2].replace(".", " ")) if not unit else f"{_of_effect(name, unit)} {unit}"


def _of_effect(name: str, unit: str) -> str:
    effect, _, key = name.partition(".")[2].rpartition(".")
    bare = "" if key == unit else key.removesuffix(f"_{unit}")
    return one_line(f"{effect} {bare}".strip())


def _without_unit(label: str) -> str:
    head, _, last = label.rpartition(" ")
    return head if last in ("mm", "m", "deg", "s", "ppm") else label


def _scale(name: str) -> float:
    return 1e3 if name in LABELS and name.endswith("_m") else 1.0


def _estimate(estimate: Estimate | None, scale: float) -> str:
    if estimate is None or estimate.status == "unobserved":
        return NONE
    value, sigma = value_and_sigma(scale * estimate.value, scale * estimate.sigma)
    return f"{value} ±{sigma}"


def _difference(pair: Pair) -> str:
    if pair.difference is None:
        return NONE
    scale = _scale(pair.name)
    value, sigma = value_and_sigma(scale * pair.difference.amount, scale * pair.difference.sigma)
    return f"{value if value.startswith('-') else f'+{value}'} ±{sigma}"


def _sigmas(count: float) -> str:
    return f"{count:+.1f}" if math.isfinite(count) else "inf"


def _nats(nats: float | None) -> str:
    return NONE if nats is None else plain(nats)


def _ratio(figure: Figure) -> str:
    return plain(figure.b / figure.a) if figure.a and figure.a > 0.0 and figure.b is not None else NONE
