"""What is left and has no name: the pattern that the residuals of the final model follow most, if they follow one.

All patterns are free beside the model, noise included, so that an error that nothing in the catalogue explains can no
longer pass for noise; the evidence then says what each pattern alone would bring, and the strongest are fitted alone.
None of them enters the model.
"""

from __future__ import annotations

import numpy as np

from sccal.arrays import Floats
from sccal.diagnose.criteria import LEAST_NATS, PATTERN_NATS
from sccal.diagnose.loop import Loop, leave_out, prices
from sccal.effects.patterns import PATTERNS, Pattern
from sccal.evidence.extension import Free, name_in
from sccal.evidence.model import Accepted, Model, refitted
from sccal.evidence.posterior import PRICE_NATS
from sccal.evidence.saturated import posterior_of, saturate
from sccal.filter.noise import Reach
from sccal.results.diagnosis import Unexplained

WINDOW_S = 10.0
MOST_TRIED = 4
"""Patterns, the most likely first, that are fitted alone."""


def unexplained(loop: Loop) -> Unexplained:
    """The strongest pattern beside the final model, where it is strong enough to be told.

    What the model holds and what brings nothing beside that pattern has only made up for it, and is taken back: a
    third harmonic of the heading, which no effect is, looks a little like readings that are early and smoothed.
    """
    found, stand_ins = _strongest(loop)
    if not stand_ins:
        return found
    for key in stand_ins:
        loop.taken_back[name_in(key)] = (
            f"it makes up for what follows {found.depends_on}, and beside that brings nothing"
        )
    leave_out(loop, stand_ins)
    return _strongest(loop)[0]


def _strongest(loop: Loop) -> tuple[Unexplained, list[str]]:
    """The pattern, and the effects of the model that do not hold beside it."""
    kept = list(loop.model.accepted)
    patterns = {pattern.name: Accepted(Free(pattern)) for pattern in PATTERNS}
    full = saturate(loop.model, [*kept, *patterns.values()], dict.fromkeys(patterns, PRICE_NATS), Reach.LOOK)
    keys = [one.key for one in kept]
    gains = {name: full.posterior.gain(name, keys) for name in patterns}
    strongest = sorted((name for name in gains if gains[name] >= PATTERN_NATS), key=lambda name: -gains[name])
    for name in strongest[:MOST_TRIED]:
        # Among all the others a pattern may have run away from where it is linear: what counts is what it is alone.
        model = refitted(loop.model, [*kept, patterns[name]], reach=Reach.LOOK)
        if found := _told(model, patterns[name], keys):
            beside = posterior_of(model, {**prices(kept), name: PRICE_NATS})
            told = [one.accepted.key for one in loop.sized if one.told]
            return found, [key for key in told if beside.worth(key, [*keys, name]) < LEAST_NATS]
    return Unexplained(False), []


def _told(model: Model, accepted: Accepted, kept: list[str]) -> Unexplained | None:
    """One pattern beside the final model, if it is what it seemed to be."""
    name, pattern = accepted.key, accepted.free.effect
    assert isinstance(pattern, Pattern)
    posterior = posterior_of(model, {name: PRICE_NATS})
    gain = posterior.gain(name, kept)
    mean, _ = posterior.of(name, [*kept, name])
    values = mean * posterior.sigma[posterior.rows[name]]
    least = max(one.matters / one.prior_sigma for one in pattern.parameters)
    low, high = (np.array([getattr(one, end) for one in accepted.free.parameters]) for end in ("lower", "upper"))
    if gain < PATTERN_NATS or float(np.abs(mean).max()) < least or np.any(values < low) or np.any(values > high):
        return None
    fraction, size = variance_fraction(model, pattern, values)
    return Unexplained(
        significant=True,
        port=pattern.port,
        depends_on=pattern.depends_on,
        variance_fraction=fraction,
        evidence_nats=gain,
        t=posterior.t(name, [*kept, name]),
        size=size,
    )


def variance_fraction(model: Model, pattern: Pattern, values: Floats) -> tuple[float, str]:
    """Share of the error's variance at the pattern's port that follows it, and its size in words.

    The model holds the pattern, so that its noise has not swallowed it. ``values`` are the pattern's parameters. At the
    motion the errors are sums over WINDOW_S, since one step says nothing.
    """
    explained, noise, most = [], [], 0.0
    own = values.tolist()
    for run, problem in enumerate(model.problems):
        at = model.at(run)
        view = model.view(run)
        placed = [one for one in Free(pattern).placed(view, own, 0) if one.column.port == pattern.port]
        added = sum(own[one.parameter] * one.column.values for one in placed)
        level = problem.noise
        if pattern.port == "heading":
            error = level.heading_white_rad**2 + level.heading_coloured_rad**2
        elif pattern.port in ("antenna_forward", "antenna_left", "east", "north"):
            error = (level.fix_scale * level.fix_stated_m) ** 2 + level.fix_coloured_m**2
        else:
            t_s = view.steps.t_s
            edges = np.arange(t_s[0], t_s[-1], WINDOW_S)
            added = np.diff(np.interp(edges, t_s, np.cumsum(added)))
            distance = float(np.abs(view.steps.along_m).sum()) / max(edges.size - 1, 1)
            error = 0.5 * level.slip_m_per_sqrt_m**2 * distance
            if pattern.port == "turn":
                error *= 4.0 / at.constants.track_m**2
        explained.append(float(np.var(added)))
        noise.append(float(error))
        most = max(most, float(np.max(np.abs(added - np.mean(added)))))
    share = float(np.mean(explained)) / max(float(np.mean(explained) + np.mean(noise)), 1e-30)
    return share, _in_words(pattern.port, most)


def _in_words(port: str, size: float) -> str:
    if port == "heading":
        return f"up to {np.degrees(size):.2g} deg"
    if port == "turn":
        return f"up to {np.degrees(size):.2g} deg in {WINDOW_S:.0f} s"
    if port in ("along", "side", "right_wheel", "left_wheel"):
        return f"up to {size:.2g} m in {WINDOW_S:.0f} s"
    return f"up to {size:.2g} m"
