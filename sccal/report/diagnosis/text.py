"""A diagnosis in words: what the terminal shows, and the sentences that the page shares with it.

One sentence says what the machine does and what knowing it brings; then the numbers, then what limits them.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Mapping, Sequence

from sccal.effects.catalogue import CATALOGUE
from sccal.effects.words import about, percent, sense, size
from sccal.report.layout import in_columns, labelled, notice_lines, shortened, wrapped
from sccal.report.rows import Row
from sccal.report.sentences import held_out_drift
from sccal.results.calibration import Estimate
from sccal.results.diagnosis import Detectable, Diagnosis, Finding, Judgement, Unexplained
from sccal.results.model import RunNoise
from sccal.results.numbers import MISSING, one_line, plain, short, value_and_sigma

FINDINGS_IN_THE_VERDICT = 2
ADVICE_SHOWN = 4
INSEPARABLE_SHOWN = 3
RUNS_NAMED = 4
JSON = "diagnosis.json"

_PORTS = {
    "heading": "the heading readings",
    "along": "the distance driven",
    "turn": "the turning",
    "side": "the sideways motion",
    "antenna_forward": "the fixes, along the robot",
    "antenna_left": "the fixes, across the robot",
    "east": "the fixes, to the east",
    "north": "the fixes, to the north",
}


def diagnosis_text(d: Diagnosis, width: int = 100) -> str:
    """The whole story, short: about 35 lines where one or two effects were found."""
    lines = [
        *wrapped(verdict_sentence(d), width),
        "",
        *wrapped(f"{runs_line(d)}: {d.trust}" if d.trust else runs_line(d), width),
        "",
    ]
    if d.findings:
        lines += [*_findings_table(d.findings, width), ""]
    lines += [*_judgement_table(d, width), *wrapped(f"  ({d.held_out_how})", width, "  "), ""]
    if not d.findings and d.detectable:
        lines += labelled("found if", [detectable_line(d.detectable)], width)
    lines += [
        *labelled("or else", [line for f in d.findings if (line := doubt_sentence(f))], width),
        *labelled("left", [unexplained_sentence(d.unexplained)], width),
        *labelled("alike", _cut(inseparable_lines(d), INSEPARABLE_SHOWN), width),
        *labelled("unseen", _cut(unseen_lines(d), ADVICE_SHOWN), width),
        *labelled("back", [f"{name} was taken back as a finding: {why}" for name, why in d.taken_back.items()], width),
        *labelled("chance", [placebo_sentence(d)], width),
        *labelled("noise", [noise_line(d.noises)], width),
        *labelled("notices", notice_lines([("", notice) for notice in d.notices], JSON), width),
    ]
    return "\n".join(lines) + "\n"


def verdict_sentence(d: Diagnosis) -> str:
    """What an engineer can act on, and what it brings, in one sentence."""
    if d.findings:
        return f"{_and([cause_clause(f) for f in d.findings], d)}: {brings_clause(d)}{_rivals(d.findings)}"
    if d.unexplained.significant:
        return f"no effect with a name was found, but something is there: {unexplained_sentence(d.unexplained)}"
    return (
        f"nothing that the model lacks was found: {judged_by(d)}, no effect explains more than chance does; "
        f"{_drift_now(d.before)}"
    )


def cause_clause(finding: Finding) -> str:
    """What the machine does: "the antenna sits 0.74 m to the right of the track centre"."""
    found = {name: estimate for name, estimate in finding.parameters.items() if math.isfinite(estimate.value)}
    where, tilde, column = finding.name.partition("~")
    said = _column_says(where, column, found) if tilde else _effect_says(finding.name, found)
    return one_line(said) if said else _generic(finding)


def brings_clause(d: Diagnosis) -> str:
    """What the findings bring where nothing was fitted."""
    if all(finding.aligned for finding in d.findings):
        return f"the stamps were put right before the fit, which lacks nothing else; {_drift_now(d.before)}"
    with_it = {1: "it", 2: "both"}.get(len(d.findings), "all of them")
    return f"with {with_it} {change_clause(d.before, d.after)}, {judged_by(d)}"


def change_clause(before: Judgement, after: Judgement) -> str:
    """The drift without fixes before and after; the fixes' innovation where no window was long enough."""
    if before.outage_end_rms_m is None or after.outage_end_rms_m is None:
        return "the innovation of the fixes " + _change(before.gnss_innovation_rms_m, after.gnss_innovation_rms_m, "m")
    change = _change(before.outage_end_rms_m, after.outage_end_rms_m, "m")
    return f"the drift after {short(after.window_s)} s without fixes {change}"


def judged_by(d: Diagnosis) -> str:
    """Which data had the word: the short form of ``held_out_how``."""
    data = "runs" if len(d.runs) > 1 else "stretches of the run"
    return f"judged on {data} that were not used for fitting"


def doubt_sentence(finding: Finding) -> str:
    """What else explains the same, and what would tell; empty where nothing does."""
    if not finding.indistinguishable_from:
        return ""
    others = " or ".join(one_line(name) for name in finding.indistinguishable_from)
    advice = f"; to tell: {one_line(finding.advice)}" if finding.advice else ""
    return f"{one_line(finding.name)} could as well be {others}{advice}"


def unexplained_sentence(left: Unexplained) -> str:
    """What is left and has no name."""
    if not left.significant:
        return "nothing more than chance leaves"
    port = _PORTS.get(left.port or "", left.port)
    facts = [
        left.size,
        f"{plain(100.0 * left.variance_fraction, 2)} % of its variance",
        f"evidence {_nats(left.evidence_nats)}",
        f"t {plain(left.t, 2)}",
    ]
    return one_line(f"the error of {port} follows {left.depends_on} ({', '.join(fact for fact in facts if fact)})")


def inseparable_lines(d: Diagnosis) -> list[str]:
    """Effects that look the same on this drive."""
    return [
        " and ".join(one_line(name) for name in group.names) + (f": {one_line(group.advice)}" if group.advice else "")
        for group in d.inseparable
    ]


def unseen_lines(d: Diagnosis) -> list[str]:
    """What this drive could not show, by what to drive."""
    by_advice: dict[str, list[str]] = {}
    for quantity in d.not_excited:
        by_advice.setdefault(one_line(quantity.advice), []).append(one_line(quantity.name))
    return [f"{', '.join(names)}: {advice}" if advice else ", ".join(names) for advice, names in by_advice.items()]


def detectable_line(detectable: Iterable[Detectable]) -> str:
    """The smallest effects that would have been found."""
    return "; ".join(f"{one_line(least.name)} {smallest_text(least)}" for least in detectable)


def smallest_text(one: Detectable) -> str:
    """``forward_m 0.03 m, left_m 0.02 m``; a parameter that is only a unit goes without its name."""
    parts = []
    for name, least in one.smallest.items():
        unit = _unit(one.units.get(name, ""))
        size_text = f"{plain(least, 2)} {unit}".strip()
        parts.append(size_text if len(one.smallest) == 1 else f"{name} {size_text}")
    return ", ".join(parts)


def placebo_sentence(d: Diagnosis) -> str:
    """This log's own false alarms."""
    if not d.placebo.tried:
        return "no nonsense column was tried, so how often chance passes is not known"
    passed = "none" if not d.placebo.passed else str(d.placebo.passed)
    return (
        f"{passed} of {_count(d.placebo.tried, 'nonsense column')} passed the usual test; the best has evidence of "
        f"{_nats(d.placebo.highest_nats)}, a finding needs {_nats(d.placebo.needed_nats)}"
    )


def noise_line(noises: Sequence[RunNoise]) -> str:
    """The noise that is left with the findings in the model, over all runs."""
    if not noises:
        return ""
    all_of = [run.noise for run in noises]
    degrees = math.degrees
    heading = _spread([degrees(n.heading_white_rad) for n in all_of], "deg")
    coloured = _spread([degrees(n.heading_coloured_rad) for n in all_of], "deg")
    fixes = _spread([n.fix_scale for n in all_of], "")
    wander = _spread([n.fix_coloured_m for n in all_of], "m")
    wheels = _spread([n.slip_m_per_sqrt_m for n in all_of], "m")
    return (
        f"heading {heading} white + {coloured} correlated, fixes {fixes} x stated sigma + {wander} correlated, "
        f"wheels {wheels} after 1 m"
    )


def runs_line(d: Diagnosis) -> str:
    """Vehicle and runs."""
    names = [shortened(one_line(run), 40) for run in d.runs[:RUNS_NAMED]]
    more = f" and {len(d.runs) - RUNS_NAMED} more" if len(d.runs) > RUNS_NAMED else ""
    return f"{one_line(d.vehicle.name)}, {_count(len(d.runs), 'run')} ({', '.join(names)}{more})"


def next_line(d: Diagnosis, runs: Sequence[str], model: str) -> str:
    """The command that makes a calibration of what was found; dots where the runs are not given."""
    where = shlex.join(runs) if runs else "…"
    if not d.model.effects:
        return f"next: sccal calibrate {where} (the model lacks nothing that these data show)"
    small = sum(not effect.told for effect in d.model.effects)
    held = f" (the model holds {_count(small, 'effect')} that is no finding above)" if small else ""
    return f"next: sccal calibrate {where} --model {shlex.quote(model)}{held}"


def judgement_rows(d: Diagnosis) -> list[tuple[str, str, str, str]]:
    """What is judged, its unit, before and after."""
    b, a = d.before, d.after
    heading_deg = [math.degrees(one.heading_innovation_rms_rad) for one in (b, a)]
    return [
        (held_out_drift(a.window_s), "m rms", _end_drift(b), _end_drift(a)),
        ("drift on the way there", "m rms", _or_dash(b.outage_rms_m), _or_dash(a.outage_rms_m)),
        ("innovation of the fixes", "m rms", plain(b.gnss_innovation_rms_m), plain(a.gnss_innovation_rms_m)),
        ("innovation of the heading", "deg rms", plain(heading_deg[0]), plain(heading_deg[1])),
        ("loss per measurement", "nats", _fixed(b.nll_per_measurement), _fixed(a.nll_per_measurement)),
    ]


def something_added(d: Diagnosis) -> bool:
    """False where before and after are the same model."""
    return bool(d.findings or d.model.effects)


def finding_rows(finding: Finding) -> tuple[Row, ...]:
    """The parameters of a finding under their names in the files."""
    return tuple(
        Row(f"{finding.name}.{name}", one_line(name), _unit(finding.units.get(name, "")), estimate)
        for name, estimate in finding.parameters.items()
    )


def title_of(name: str, d: Diagnosis) -> str:
    """What an effect is, in a few words; its name where nothing says more."""
    titles = {quantity.name: quantity.title for quantity in d.not_excited}
    titles |= {least.name: least.title for least in d.detectable}
    titles |= {ranked.name: ranked.title for f in d.findings for ranked in f.ranking}
    titles |= {f.name: f.title for f in d.findings}
    return titles.get(name) or (CATALOGUE[name].title if name in CATALOGUE else name)


def _findings_table(findings: Sequence[Finding], width: int) -> list[str]:
    table = [("effect", "parameter", "value", "", "unit", "nats", "t")]
    reasons = []
    for finding in findings:
        for k, row in enumerate(finding_rows(finding)):
            first = k == 0
            table.append(
                (
                    shortened(one_line(finding.name), max(width // 4, 12)) if first else "",
                    shortened(row.name, 16),
                    row.value,
                    f"± {row.sigma}" if row.sigma not in ("", MISSING) else "",
                    row.unit,
                    plain(finding.evidence_nats, 3) if first else "",
                    plain(finding.t, 2) if first else "",
                )
            )
            if row.estimate.status != "estimated":
                reasons.append(f"{finding.name} {row.name}: {row.status}; {row.reason}".removesuffix("; "))
    return [*in_columns(table, "<<><<>>"), *(line for reason in reasons for line in wrapped(reason, width, "  "))]


def _judgement_table(d: Diagnosis, width: int) -> list[str]:
    header = ("held out", "", "before", "after") if something_added(d) else ("held out", "", "as it is", "")
    table = [header, *(row if something_added(d) else (*row[:3], "") for row in judgement_rows(d))]
    room = width - sum(2 + max(map(len, column)) for column in list(zip(*table, strict=True))[1:])
    return in_columns([(shortened(what, max(room, 8)), *rest) for what, *rest in table], "<<>>")


def _end_drift(judgement: Judgement) -> str:
    if judgement.outage_end_rms_m is None:
        return "-"
    interval = judgement.outage_end_interval_m
    between = "" if interval is None else f" ({plain(interval[0], 2)} … {plain(interval[1], 2)})"
    return f"{plain(judgement.outage_end_rms_m, 3)}{between}"


def _drift_now(judgement: Judgement) -> str:
    window = short(judgement.window_s)
    if judgement.outage_end_rms_m is None:
        return f"no window of {window} s without fixes fits into the data"
    return f"the drift after {window} s without fixes is {about(judgement.outage_end_rms_m)} m"


def _fixed(value: float) -> str:
    return f"{value:.3f}" if math.isfinite(value) else MISSING


def _or_dash(value: float | None) -> str:
    return "-" if value is None else plain(value, 3)


def _change(before: float, after: float, unit: str) -> str:
    was, now = about(before), about(after)
    if was == now:
        return f"stays at {now} {unit}"
    return f"{'falls' if after < before else 'rises'} from {was} {unit} to {now} {unit}"


def _nats(value: float) -> str:
    return f"{plain(value, 3 if abs(value) >= 100.0 else 2)} nats"


def _spread(values: Sequence[float], unit: str) -> str:
    low, high = (plain(of, 2) for of in (min(values), max(values)))
    return f"{low if low == high else f'{low} … {high}'} {unit}".strip()


def _rivals(findings: Sequence[Finding]) -> str:
    """A verdict must not sound surer than the drive allows."""
    names = dict.fromkeys(one_line(name) for f in findings for name in f.indistinguishable_from)
    return f"; {' or '.join(names)} would explain the same as well" if names else ""


def _and(clauses: Sequence[str], d: Diagnosis) -> str:
    shown, rest = clauses[:FINDINGS_IN_THE_VERDICT], d.findings[FINDINGS_IN_THE_VERDICT:]
    text = ", and ".join(shown)
    if not rest:
        return text
    return f"{text}, and {_count(len(rest), 'more effect')} ({', '.join(one_line(f.name) for f in rest)})"


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _cut(lines: Sequence[str], most: int) -> list[str]:
    if len(lines) <= most:
        return list(lines)
    return [*lines[:most], f"… and {len(lines) - most} more in {JSON}"]


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit


def _generic(finding: Finding) -> str:
    values = []
    for name, estimate in finding.parameters.items():
        number = value_and_sigma(estimate.value, estimate.sigma)[0]
        if number != MISSING:
            values.append(f"{name} {number} {_unit(finding.units.get(name, ''))}".strip())
    return one_line(finding.title + (f" ({', '.join(values)})" if values else ""))


def _effect_says(name: str, found: Mapping[str, Estimate]) -> str:
    """Empty where it says no more than its title, or where a value that it needs is missing."""
    effect = CATALOGUE.get(name)
    if effect is None or any(
        parameter.default is None and parameter.name not in found for parameter in effect.parameters
    ):
        return ""
    said = effect.says(found)
    return "" if said == effect.title else said


def _column_says(where: str, column: str, found: Mapping[str, Estimate]) -> str:
    """What follows a column of the log; empty where there are no words for it."""
    angle, share = found.get("deg_per_unit"), found.get("per_unit")
    if where == "heading" and angle:
        return f"the AHRS heading turns with {column}, by {size(angle)} deg {sense(angle)} per unit"
    if where == "along" and share:
        return f"the distance driven changes with {column}, by {_signed_percent(share)} per unit"
    if where == "yaw" and share:
        return f"the turning changes with {column}, by {_signed_percent(share)} per unit"
    if where == "side" and share:
        way = "left" if share.value > 0.0 else "right"
        return f"{column} pushes the robot to the {way}, by {percent(share)} of the distance driven per unit"
    return ""


def _signed_percent(share: Estimate) -> str:
    return f"{'+' if share.value > 0.0 else '-'}{percent(share)}"
