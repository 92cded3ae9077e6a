"""How much of the error at a port a pattern without a name holds."""

from __future__ import annotations

import numpy as np

from sccal.arrays import Floats
from sccal.calibration.extension import Free, view_run
from sccal.diagnose.model import Model, names_of
from sccal.effects.patterns import Pattern

WINDOW_S = 10.0


def variance_fraction(model: Model, pattern: Pattern, values: Floats | None) -> tuple[float, str]:
    """Share of the error's variance at the pattern's port that follows it, and its size in words.

    ``values`` are the pattern's parameters where it is not in the model; None: those of the model. At the motion the
    errors are sums over WINDOW_S, since one step says nothing.
    """
    explained, noise, most = [], [], 0.0
    for run, problem in enumerate(model.problems):
        at = model.at(run)
        free = Free(pattern)
        known = dict(zip(names_of(problem), at.values.tolist(), strict=True))
        own = [known.get((pattern.name, one.name), 0.0) for one in free.parameters] if values is None else list(values)
        view = view_run(problem, at, problem.clear_steps(at.constants))
        placed = [one for one in free.placed(view, own, 0) if one.column.port == pattern.port]
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
