"""Do the innovations have the size that the filter expects of them, and all the time?"""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.special import chdtri

from sccal.arrays import Bools, Floats
from sccal.filter.forward import ForwardPass, fix_nis
from sccal.filter.iterate import RunProblem
from sccal.results.calibration import Consistency

STRETCHES = 48
FEWEST_IN_STRETCH = 5
OUTSIDE = 0.05


def consistency_over_time(problem: RunProblem, found: ForwardPass) -> tuple[Consistency, ...]:
    """Of fixes (two degrees of freedom each) and headings (one) of one pass; what was never measured is left out."""
    aligned, timeline = problem.aligned, problem.timeline
    of_fixes, _ = fix_nis(found.fix_nu_m, found.fix_var_m2)
    heading_nis = found.heading_nu_rad**2 / found.heading_var_rad2
    both = (
        in_stretches("fixes", aligned.fix_t_s[timeline.fix_index], of_fixes, found.fix_accepted, 2, aligned.span_s),
        in_stretches(
            "headings",
            aligned.heading_t_s[timeline.heading_index],
            heading_nis,
            found.heading_accepted,
            1,
            aligned.span_s,
        ),
    )
    return tuple(one for one in both if one.t_s.size)


def in_stretches(
    measured: Literal["fixes", "headings"],
    t_s: Floats,
    nis: Floats,
    accepted: Bools,
    dof: int,
    span_s: tuple[float, float],
) -> Consistency:
    """Means over STRETCHES of the span, from times (n,) and normalised innovations squared (n,)."""
    t_s, nis = t_s[accepted], nis[accepted]
    length = max((span_s[1] - span_s[0]) / STRETCHES, 1e-9)
    place = np.clip((t_s - span_s[0]) / length, 0, STRETCHES - 1).astype(np.int64)
    count = np.bincount(place, minlength=STRETCHES)
    enough = count >= FEWEST_IN_STRETCH
    n = count[enough] * dof
    mean = np.bincount(place, nis, STRETCHES)[enough] / n
    return Consistency(
        measured=measured,
        t_s=np.asarray(span_s[0] + length * (np.arange(STRETCHES) + 0.5), dtype=np.float64)[enough],
        nis=mean,
        low=np.asarray(chdtri(n, 1.0 - 0.5 * OUTSIDE) / n),
        high=np.asarray(chdtri(n, 0.5 * OUTSIDE) / n),
        inside=float(np.mean(nis <= chdtri(dof, OUTSIDE))) if nis.size else float("nan"),
    )
