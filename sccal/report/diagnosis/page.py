"""diagnosis.html: the story of a diagnosis on one self-contained page, for readers who were not there."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sccal import __version__
from sccal.effects.catalogue import CATALOGUE
from sccal.report.diagnosis.figures import drift_drawing, finding_drawings, unexplained_drawing
from sccal.report.diagnosis.text import (
    brings_clause,
    cause_clause,
    doubt_sentence,
    finding_rows,
    judgement_rows,
    next_line,
    placebo_sentence,
    smallest_text,
    something_added,
    title_of,
    unexplained_sentence,
    verdict_sentence,
)
from sccal.report.drawing.style import Drawing
from sccal.report.layout import sentence, shortened
from sccal.report.page import page
from sccal.report.rows import Row, parameter_rows
from sccal.report.sentences import warnings_first
from sccal.results.diagnosis import Diagnosis, Finding
from sccal.results.files import MODEL_FILE
from sccal.results.model import RunNoise
from sccal.results.numbers import one_line, plain, short

RUNS_LISTED = 6


@dataclass(frozen=True)
class Headline:
    """What stands at the top of the page: a few words in bold, then sentences."""

    level: str
    because: tuple[str, ...]


@dataclass(frozen=True)
class Step:
    """One finding as the page tells it."""

    number: int
    name: str
    title: str
    clause: str
    looks_like: str
    rows: tuple[Row, ...]
    drawings: tuple[Drawing, ...]
    facts: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Named:
    """An effect by its name and in words, with something to say about it."""

    name: str
    title: str
    says: str


def diagnosis_html(d: Diagnosis) -> str:
    """The page."""
    constants = zip(parameter_rows(d.parameters_before), parameter_rows(d.parameters_after), strict=True)
    return page(
        "diagnosis.html.j2",
        d=d,
        verdict=_headline(d),
        runs=_runs(d),
        trust=sentence(d.trust),
        steps=[_step(d, number) for number in range(len(d.findings))],
        constants=list(constants),
        added=something_added(d),
        judged=judgement_rows(d),
        held_out_how=sentence(d.held_out_how),
        windows=len(d.after.windows),
        drift=drift_drawing(d),
        alternatives=[_alternative(d, finding) for finding in d.findings if finding.indistinguishable_from],
        unexplained=sentence(unexplained_sentence(d.unexplained)),
        unexplained_drawing=unexplained_drawing(d.unexplained),
        not_excited=[Named(quantity.name, quantity.title, sentence(quantity.advice)) for quantity in d.not_excited],
        inseparable=[(group.names, sentence(group.advice)) for group in d.inseparable],
        detectable=[Named(least.name, least.title, smallest_text(least)) for least in d.detectable],
        placebo=sentence(placebo_sentence(d)),
        taken_back=[Named(name, title_of(name, d), sentence(why)) for name, why in d.taken_back.items()],
        noises=[_noise_cells(noise) for noise in d.noises],
        notices=warnings_first(d.notices),
        next_line=next_line(d, (), f"OUT/{MODEL_FILE}").removeprefix("next: "),
        version=__version__,
    )


def _headline(d: Diagnosis) -> Headline:
    count = len(d.findings)
    if count:
        level = f"found: {count} effect{'' if count == 1 else 's'} beyond the model"
        clauses = [sentence(cause_clause(finding)) for finding in d.findings]
        doubts = [sentence(doubt) for finding in d.findings if (doubt := doubt_sentence(finding))]
        left = [sentence(f"Left without a name: {unexplained_sentence(d.unexplained)}")]
        if count == 1:
            clauses = [sentence(f"{cause_clause(d.findings[0])}: {brings_clause(d)}")]
        else:
            clauses.append(sentence(brings_clause(d)))
        return Headline(level, (*clauses, *doubts, *(left if d.unexplained.significant else [])))
    if d.unexplained.significant:
        return Headline("left without a name", (sentence(verdict_sentence(d)),))
    return Headline("nothing found", (sentence(verdict_sentence(d)),))


def _step(d: Diagnosis, number: int) -> Step:
    finding = d.findings[number]
    known = CATALOGUE.get(finding.name)
    return Step(
        number=number + 1,
        name=finding.name,
        title=sentence(finding.title, stop=False),
        clause=sentence(cause_clause(finding)),
        looks_like=sentence(known.looks_like) if known else "",
        rows=finding_rows(finding),
        drawings=finding_drawings(d, number),
        facts=_evidence(d, finding),
    )


def _evidence(d: Diagnosis, finding: Finding) -> tuple[tuple[str, str], ...]:
    drift = ""
    if finding.drift_before_m is not None and finding.drift_after_m is not None:
        drift = (
            f"{plain(finding.drift_before_m)} m without, {plain(finding.drift_after_m)} m with it, "
            f"rms after {short(d.after.window_s)} s without fixes, held out"
        )
    return (
        ("evidence", f"{plain(finding.evidence_nats, 3)} nats (needed: {plain(d.placebo.needed_nats, 2)})"),
        ("gain on held-out data", f"{plain(finding.held_out_gain_nats, 3)} nats"),
        ("size", f"{plain(finding.t, 2)} times its standard deviation"),
        ("drift with this step", drift),
        ("could as well be", ", ".join(title_of(name, d) for name in finding.indistinguishable_from)),
        ("source", one_line(finding.reference)),
    )


def _alternative(d: Diagnosis, finding: Finding) -> tuple[str, list[Named], str]:
    others = [Named(name, title_of(name, d), "") for name in finding.indistinguishable_from]
    return finding.name, others, sentence(finding.advice)


def _runs(d: Diagnosis) -> str:
    names = ", ".join(shortened(one_line(run), 40) for run in d.runs[:RUNS_LISTED])
    more = f" and {len(d.runs) - RUNS_LISTED} more" if len(d.runs) > RUNS_LISTED else ""
    return f"{len(d.runs)} run{'' if len(d.runs) == 1 else 's'}: {names}{more}"


def _noise_cells(one: RunNoise) -> tuple[str, ...]:
    n = one.noise
    return (
        one_line(one.run),
        plain(math.degrees(n.heading_white_rad), 2),
        plain(math.degrees(n.heading_coloured_rad), 2),
        plain(n.heading_tau_s, 2),
        plain(n.fix_scale, 2),
        plain(n.fix_coloured_m, 2),
        plain(n.fix_tau_s, 2),
        plain(n.slip_m_per_sqrt_m, 2),
    )
