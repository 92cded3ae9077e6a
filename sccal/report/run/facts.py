"""What a page tells in tables beside its figures: the drive, how well it shows each parameter, and its sources."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import datetime

from sccal.report.rows import parameter_rows
from sccal.report.sentences import (
    fixes_line,
    headings_line,
    held_out_line,
    missing_line,
    outage_line,
    recoveries_line,
    reference_lines,
    unseen_line,
)
from sccal.results.calibration import Calibration, Fit, HeldOut, Manoeuvre, Outage, Provenance
from sccal.results.numbers import MISSING, duration, one_line, plain, short

KINDS = {
    "straight": "straight ahead",
    "straight_back": "straight back",
    "arc_left": "arcs to the left",
    "arc_right": "arcs to the right",
    "spin_left": "turns in place, left",
    "spin_right": "turns in place, right",
    "standing": "standing",
}


@dataclass(frozen=True)
class Driven:
    """One line of the table of manoeuvres."""

    kind: str
    time: str
    distance: str
    turned: str
    speed: str


@dataclass(frozen=True)
class Narrowed:
    """One line of the table of what the drive shows: how much narrower a parameter has become."""

    name: str
    before: str
    after: str
    times: str


def driven_lines(manoeuvres: tuple[Manoeuvre, ...]) -> tuple[Driven, ...]:
    """Every kind of driving, with those that are missing among the first six, because they are what to drive next."""
    if not manoeuvres:
        return ()
    of_kind = {manoeuvre.kind: manoeuvre for manoeuvre in manoeuvres}
    lines = []
    for kind, name in KINDS.items():
        one = of_kind.get(kind)  # type: ignore[call-overload]
        if one is None:
            lines.append(Driven(name, "none", "", "", ""))
            continue
        standing = kind == "standing"
        low, high = (plain(speed, 2) for speed in one.speed_mps)
        lines.append(
            Driven(
                name,
                duration(one.duration_s),
                "" if standing else f"{plain(one.distance_m, 2)} m",
                "" if standing else f"{math.degrees(one.turned_rad):.0f} deg",
                "" if standing else f"{low} to {high} m/s",
            )
        )
    return tuple(lines)


def narrowed_lines(c: Calibration) -> tuple[Narrowed, ...]:
    """Each parameter's sigma before the run and after it."""
    lines = []
    for row in parameter_rows(c.parameters):
        prior, sigma = row.estimate.prior_sigma, row.estimate.sigma
        if row.estimate.status == "held":
            lines.append(Narrowed(row.name, "held", "held", ""))
            continue
        known = prior is not None and math.isfinite(sigma) and sigma > 0.0
        lines.append(
            Narrowed(
                row.name,
                "unknown" if prior is None else f"{plain(prior, 2)} {row.unit}",
                f"{plain(sigma, 2)} {row.unit}" if math.isfinite(sigma) else MISSING,
                f"{short((prior or 0.0) / sigma, 2)}" if known else "",
            )
        )
    return tuple(lines)


def origin_lines(provenance: Provenance) -> tuple[tuple[str, str], ...]:
    """Versions and options, by name."""
    versions = ", ".join(f"{one_line(name)} {one_line(text)}" for name, text in provenance.versions.items())
    options = ", ".join(f"{one_line(name)} = {one_line(text)}" for name, text in provenance.options.items() if text)
    return (("versions", versions), ("options", options))


def fit_facts(c: Calibration) -> tuple[tuple[str, str], ...]:
    """Fit, drift and what these data would not show; nothing empty."""
    facts = (
        *fit_and_outage(c.fit, c.outage, c.held_out),
        ("lacks", missing_line(c.missing)),
        *(("judged", line) for line in reference_lines(c.against_reference)),
        ("unseen", unseen_line(c.unseen)),
    )
    return tuple((name, text) for name, text in facts if text)


def fit_and_outage(fit: Fit, outage: Outage, held_out: HeldOut | None) -> tuple[tuple[str, str], ...]:
    """Of a run or of several."""
    return (
        ("fixes", fixes_line(fit)),
        ("heading", headings_line(fit)),
        ("filter", recoveries_line(fit)),
        ("drift, held out", held_out_line(held_out, outage.window_s)),
        ("drift on the way", outage_line(outage)),
        ("how", one_line(outage.how) if outage.windows else ""),
    )


def started(c: Calibration) -> str:
    """``2026-05-03 14:05 UTC``; empty where the log has no date."""
    if c.started is None:
        return ""
    return f"{datetime.fromisoformat(c.started):%Y-%m-%d %H:%M} UTC"


def variant(with_offset: bool) -> str:
    """Which of the paper's filters it was."""
    return "SC EKF with offset estimation" if with_offset else "SC EKF"
