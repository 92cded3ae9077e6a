"""What is left and has no name: the pattern that the residuals of the final model follow most, if they follow one.

All patterns are free beside the model, noise included, so that an error that nothing in the catalogue explains can no
longer pass for noise; the evidence then says what each pattern alone would bring. None of them enters the model.
"""

from __future__ import annotations

import numpy as np

from sccal.arrays import Floats
from sccal.diagnose.criteria import PATTERN_NATS
from sccal.diagnose.loop import Loop
from sccal.diagnose.result import Unexplained
from sccal.effects.patterns import PATTERNS, Pattern
from sccal.evidence.extension import Free
from sccal.evidence.model import Accepted, Model
from sccal.evidence.posterior import PRICE_NATS, Posterior
from sccal.evidence.saturated import saturate
from sccal.filter.noise import Reach

WINDOW_S = 10.0


def unexplained(loop: Loop) -> Unexplained:
    """The strongest pattern beside the final model, where it is strong enough to be told."""
    kept = list(loop.model.accepted)
    patterns = {pattern.name: Accepted(Free(pattern)) for pattern in PATTERNS}
    full = saturate(loop.model, [*kept, *patterns.values()], dict.fromkeys(patterns, PRICE_NATS), Reach.LOOK)
    posterior, keys = full.posterior, [one.key for one in kept]
    within = [name for name in patterns if _is_within_bounds(posterior, [*keys, name], name, patterns[name].free)]
    gains = {name: posterior.gain(name, keys) for name in within}
    if not gains:
        return Unexplained(False)
    best = max(gains, key=lambda name: gains[name])
    pattern = patterns[best].free.effect
    assert isinstance(pattern, Pattern)
    mean, _ = posterior.of(best, [*keys, best])
    least = max(one.matters / one.prior_sigma for one in pattern.parameters)
    if gains[best] < PATTERN_NATS or float(np.abs(mean).max()) < least:
        return Unexplained(False)
    values = mean * posterior.sigma[posterior.rows[best]]
    fraction, size = variance_fraction(full.model, pattern, values)
    return Unexplained(
        significant=True,
        port=pattern.port,
        depends_on=pattern.depends_on,
        variance_fraction=fraction,
        evidence_nats=gains[best],
        t=posterior.t(best, [*keys, best]),
        size=size,
    )


def _is_within_bounds(posterior: Posterior, kept: list[str], name: str, free: Free) -> bool:
    """Whether a pattern beside the model stays where it can be a description: beyond, its fit has run away."""
    values = posterior.of(name, kept)[0] * posterior.sigma[posterior.rows[name]]
    low, high = (np.array([getattr(one, end) for one in free.parameters]) for end in ("lower", "upper"))
    return bool(np.all((values > 0.25 * low) & (values < 0.25 * high)))


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
