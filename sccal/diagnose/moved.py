"""Effects that the alignment has put right before anything was fitted: streams whose stamps are clearly late or early.

A stream that goes together with the wheels only at other times than its stamps say is moved there, so that no fit sees
the effect. It is there all the same, and its size is what the stamps were moved by, back to front.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sccal.align import Aligned
from sccal.diagnose.criteria import LEAST_T
from sccal.effects.catalogue import CATALOGUE
from sccal.effects.effect import Effect
from sccal.results.calibration import Estimate
from sccal.results.diagnosis import Finding


def with_moved(found: Sequence[Finding], runs: Sequence[Aligned]) -> tuple[Finding, ...]:
    """The findings of a fit, and with them what the alignment put right; what both see is one finding."""
    findings = {one.name: one for one in found}
    first: list[Finding] = []
    for effect in CATALOGUE.values():
        moved = _moved(effect, runs)
        if moved is None:
            continue
        if effect.name in findings:
            whole = _together(findings[effect.name], moved)
            findings[effect.name] = whole
            # A smoothed stream lags, is moved to where it fits best, and is moved back by the fit that knows better.
            if abs(next(iter(whole.parameters.values())).value) < effect.parameters[0].matters:
                _leave_out(findings, effect.name)
        else:
            first.append(moved)
    return (*first, *findings.values())


def _leave_out(findings: dict[str, Finding], name: str) -> None:
    """Take a finding away: the one before it ends where it ended, or else the next begins where it began."""
    order = list(findings)
    place, gone = order.index(name), findings.pop(name)
    if place:
        findings[order[place - 1]] = replace(findings[order[place - 1]], drift_after_m=gone.drift_after_m)
    elif len(order) > 1:
        findings[order[1]] = replace(findings[order[1]], drift_before_m=gone.drift_before_m)


def _moved(effect: Effect, runs: Sequence[Aligned]) -> Finding | None:
    """The finding that the moved stamps of some runs make, where they tell of an effect that can be so large."""
    if effect.undone_for is None:
        return None
    parameter = effect.parameters[0]
    shifts = [run.moved.get(effect.undone_for) for run in runs]
    each = [
        Estimate(0.0, 0.0, "estimated")
        if one is None
        else Estimate(-one.offset_s, float(np.hypot(one.sigma_s, parameter.hidden_sigma)), "estimated")
        for one in shifts
    ]
    seen = [one for one, shift in zip(each, shifts, strict=True) if shift is not None]
    if not seen:
        return None
    value, sigma = (float(np.mean([getattr(one, name) for one in seen])) for name in ("value", "sigma"))
    t = abs(value) / sigma
    if not parameter.matters <= abs(value) <= parameter.upper or t < LEAST_T:
        return None
    return Finding(
        name=effect.name,
        title=effect.title,
        reference=effect.reference,
        parameters={parameter.name: Estimate(value, sigma, "estimated", "", None, parameter.prior_sigma)},
        units={parameter.name: parameter.unit},
        evidence_nats=0.5 * t**2,
        held_out_gain_nats=float("nan"),
        t=t,
        indistinguishable_from=(),
        advice="",
        ranking=(),
        drift_before_m=None,
        drift_after_m=None,
        picture=None,
        per_run={parameter.name: tuple(each)} if len(runs) > 1 else {},
        aligned=True,
    )


def _together(fitted: Finding, moved: Finding) -> Finding:
    """What was moved and what the fit still found of the same."""
    (name, rest), (_, before) = next(iter(fitted.parameters.items())), next(iter(moved.parameters.items()))
    per_run = {
        key: tuple(replace(a, value=a.value + b.value) for a, b in zip(each, moved.per_run[key], strict=True))
        for key, each in fitted.per_run.items()
        if key in moved.per_run
    }
    whole = replace(rest, value=rest.value + before.value)
    return replace(fitted, parameters={name: whole}, per_run={**fitted.per_run, **per_run})
