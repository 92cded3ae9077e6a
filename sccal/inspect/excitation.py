"""What this drive shows: the constants of the model, and every effect of the catalogue that needs no search.

Where the log can be aligned, one pass with every candidate free at typical noise gathers the information about all of
them, which, with small amounts of everything else allowed, gives the standard deviation that an estimate would have.
Where it cannot, the shape of the drive has to answer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from sccal.align import Aligned, build_timeline
from sccal.arrays import Floats
from sccal.calibration.status import OFFSET_UNOBSERVED_RAD, UNOBSERVED_RATIO
from sccal.calibration.unseen import STANDS_OUT
from sccal.effects.catalogue import CATALOGUE
from sccal.effects.drive_shape import TURN_RAD
from sccal.effects.effect import Effect
from sccal.evidence.confounding import SAME, correlation, reduced
from sccal.evidence.extension import Free, FreeEffects, plain_forms
from sccal.filter.iterate import RunProblem
from sccal.filter.options import FilterOptions
from sccal.filter.start import coarse_constants, find_start
from sccal.results.inspection import DriveFacts, Excited, Shown
from sccal.results.noise import Noise

NEVER_GATE = 1e3
ANYWHERE_M, ANY_YAW_RAD = 100.0, 1.0
WHEEL_RATE_HZ, HEADING_RATE_HZ, FIX_RATE_HZ = 5.0, 2.0, 1.0
FASTEST_HZ = 20.0
STEPS_PER_TURN = 4.0
"""What turns with a wheel shows only where its turns are resolved."""
MOST_FIXES = 3600
"""More would take longer and show the same: a longer run is looked at in proportion more coarsely."""
GOOD_SHARE = 0.1
"""Of its prior's sigma: a constant known so well is shown, one known worse is shown weakly."""
WEAK_SHARE = 0.25
"""Of an effect's prior: the noise of the heading passes for small turns, by which a straight line shows a little."""
NUISANCE = 0.5
CORE = {
    "radii": ("wheel radii", "drive straights of 20 m and more, with fixes"),
    "track": ("track", "turn both ways: arcs, or spins in place"),
    "heading_offset": ("heading offset", "drive at least 10 m forward, with fixes"),
}


def typical_noise(aligned: Aligned) -> Noise:
    """What an AHRS, a receiver of the stated accuracy and wheels usually do; nothing is estimated."""
    stated_m = float(np.median(np.sqrt(aligned.fix_var_east_m2[aligned.fix_leading])))
    return Noise(np.radians(0.2), np.radians(0.7), 25.0, 1.0, stated_m, 40.0, 0.005, "given", {}, stated_m)


def excited_by_pass(aligned: Aligned) -> tuple[Excited, ...]:
    """The constants, then the effects of the catalogue. Raises DataError where the robot hardly moves."""
    # Nothing is known of where the robot starts: a guess would pass for knowledge of the antenna's place.
    start = replace(find_start(aligned), sigma_position_m=ANYWHERE_M, sigma_yaw_rad=ANY_YAW_RAD)
    first, last = aligned.span_s
    slower = max(1.0, FIX_RATE_HZ * (last - first) / MOST_FIXES)
    timeline = build_timeline(
        aligned, 0.01, HEADING_RATE_HZ / slower, FIX_RATE_HZ / slower, wheel_rate_hz=_wheel_rate_hz(aligned) / slower
    )
    asked = plain_forms()
    problem = RunProblem(
        aligned,
        timeline,
        start,
        typical_noise(aligned),
        FilterOptions(gate_sigmas=NEVER_GATE),
        FreeEffects(tuple(asked)),
    )
    at = problem.at_centre(coarse_constants(aligned, start))
    run = problem.begun(at, True, with_sigmas=False)
    found = run.finish()
    prior = np.array([one.prior_sigma for free in asked for one in free.parameters])
    information = np.linalg.inv(run.belief.params / np.outer(prior, prior)) - np.eye(prior.size)
    return (*_constants(found.final_covariance, problem), *_effects([one.effect for one in asked], information))


def _wheel_rate_hz(aligned: Aligned) -> float:
    t_s = np.arange(*aligned.span_s, 1.0)
    turns = np.abs(np.diff(np.interp(t_s, aligned.wheel_t_s, aligned.right_rad))) / (2.0 * np.pi)
    fast = float(np.quantile(turns, 0.9)) if turns.size else 0.0
    return float(np.clip(STEPS_PER_TURN * fast, WHEEL_RATE_HZ, FASTEST_HZ))


def _constants(covariance: Floats, problem: RunProblem) -> list[Excited]:
    # Given that no effect is there: what the drive shows of the constants themselves.
    constants = np.r_[3:7]
    effects = np.arange(10, covariance.shape[0])
    across = covariance[np.ix_(constants, effects)]
    given = covariance[np.ix_(constants, constants)] - across @ np.linalg.solve(
        covariance[np.ix_(effects, effects)], across.T
    )
    sigma = np.sqrt(np.maximum(np.diag(given), 0.0))
    prior = np.sqrt(np.diag(problem.prior))
    ratio = {
        "radii": float((sigma[:2] / prior[:2]).max()),
        "track": float(sigma[2] / prior[2]),
        "heading_offset": float(UNOBSERVED_RATIO * sigma[3] / OFFSET_UNOBSERVED_RAD),
    }
    sigmas = {
        "radii": {"radius_right_m": float(sigma[0]), "radius_left_m": float(sigma[1])},
        "track": {"track_m": float(sigma[2])},
        "heading_offset": {"heading_offset_deg": float(np.degrees(sigma[3]))},
    }
    return [
        Excited(name, title, _graded(ratio[name]), advice, sigmas[name], {key: _unit(key) for key in sigmas[name]})
        for name, (title, advice) in CORE.items()
    ]


def _graded(ratio: float) -> Shown:
    return "yes" if ratio < GOOD_SHARE else "weak" if ratio < UNOBSERVED_RATIO else "no"


def _unit(name: str) -> str:
    return name.rpartition("_")[2]


def _effects(asked: Sequence[Effect], information: Floats) -> list[Excited]:
    """information (K, K) about all parameters, in units of their priors."""
    parameters = [one for effect in asked for one in Free(effect).parameters]
    prior = np.array([one.prior_sigma for one in parameters])
    small = NUISANCE * np.array([one.matters / one.prior_sigma if one.matters > 0 else 0.1 for one in parameters])
    bounds = np.cumsum([0, *(len(Free(effect).parameters) for effect in asked)])
    rows = {effect.name: np.arange(a, b) for effect, a, b in zip(asked, bounds[:-1], bounds[1:], strict=True)}
    found: list[tuple[Effect, Shown, Floats]] = []
    for effect in asked:
        own = rows[effect.name]
        sigma = np.sqrt(np.diag(np.linalg.inv(reduced(information, own, small) + np.eye(own.size))))
        least = np.array([one.matters / one.prior_sigma for one in Free(effect).parameters]) + STANDS_OUT * sigma
        shown: Shown = "yes" if (least <= 1.0).all() else "weak" if (sigma <= WEAK_SHARE).any() else "no"
        found.append((effect, shown, sigma * prior[own]))
    seen = [effect.name for effect, _, sigma in found if (sigma <= UNOBSERVED_RATIO * prior[rows[effect.name]]).all()]
    same: dict[str, list[str]] = {name: [] for name in rows}
    for k, one in enumerate(seen):
        for other in seen[k + 1 :]:
            if correlation(information, rows[one], rows[other], small) > SAME:
                same[one].append(other)
                same[other].append(one)
    excited = []
    for effect, shown, sigma in found:
        names = [one.name for one in Free(effect).parameters]
        twins = () if shown == "no" else tuple(same[effect.name])
        excited.append(
            Excited(
                name=effect.name,
                title=effect.title,
                shown="weak" if shown == "yes" and twins else shown,
                advice=effect.excited_by,
                sigmas=dict(zip(names, sigma.tolist(), strict=True)),
                units={one.name: one.unit for one in Free(effect).parameters},
                same_as=twins,
            )
        )
    return excited


_RULES: dict[str, Callable[[DriveFacts], bool]] = {
    "radii": lambda drive: _distance(drive) > 20.0,
    "track": lambda drive: drive.turned_left_rad + drive.turned_right_rad > TURN_RAD,
    "heading_offset": lambda drive: _distance(drive) > 10.0,
}
"""What the shape of the drive must hold for a constant, when there is no pass to ask."""


def excited_by_shape(drive: DriveFacts) -> tuple[Excited, ...]:
    """Rules of thumb: what a drive of this shape would show if its streams could be brought together."""
    constants = [_by_rule(name, *CORE[name], holds(drive)) for name, holds in _RULES.items()]
    effects = [
        _by_rule(effect.name, effect.title, effect.excited_by, shown)
        for effect in CATALOGUE.values()
        if (shown := effect.shown_by(drive)) is not None
    ]
    return (*constants, *effects)


def _by_rule(name: str, title: str, advice: str, shown: bool) -> Excited:
    return Excited(name, title, "yes" if shown else "no", advice, {}, {})


def _distance(drive: DriveFacts) -> float:
    return (drive.distance_fixes_m or 0.0) if drive.distance_wheels_m is None else drive.distance_wheels_m
