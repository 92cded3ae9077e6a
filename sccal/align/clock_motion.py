"""Do the fixes' clock and the wheels' clock agree? If they clearly do not, by how much, from the motion alone.

Lags at which both streams move together come from `clock_search`, their offset and skew from `clock_fit`. A drive may
repeat itself (laps, rows, a circle at one speed), so several offsets may fit equally well: then clocks that agree as
logged are left alone; else the only offset at which both streams begin and end together is taken; else nothing is
guessed.
A mismatch that a late receiver could make is left too: a latency and a skew of that size are effects, and diagnosed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sccal.align.clock_fit import ClockFit, Fixes, WheelPath, fit_clock
from sccal.align.clock_search import Lag, find_lags
from sccal.arrays import Floats
from sccal.errors import DataError
from sccal.logs.names import ENCODER_FILE
from sccal.logs.streams import Notice
from sccal.results.clock import Clock

LATENCY_S = 0.3
"""Receivers and radio links are late by as much; what is more is a matter of clocks."""
USUAL_SKEW = 5e-5
"""Crystals of computers are off by as much where nobody steers them."""
CLEAR_SIGMAS = 5.0
CLEARLY_WORSE = 4.0
WORSE_RATIO = 1.25
"""The mean of the blocks' costs must be larger by so many standard errors, and by this factor."""
MUCH_WORSE = 6.0
"""Of a block's cost: noise does not make it so much larger."""
MOST_COVERED = 0.97
"""An offset that leaves out more of the motion than the clocks as logged must not win by what it leaves out."""
SAME_S = 1.0
NEAR_S = 2.0
"""Within this a fit that starts at the clocks as logged has not run away to another part of the drive."""
TOGETHER_S = 10.0
MOST_FITTED = 8
FEWEST_BLOCKS = 3
KNOWN_S = 0.3
"""An offset less certain than this is a doubt."""
KNOWN_HEADING_DEG = 0.05
"""And so is one that leaves the heading offset uncertain by this much, which the filter's own sigma does not hold."""


@dataclass(frozen=True)
class MotionClock:
    """What to add to the fixes' times: offset + skew · (t − reference)."""

    fit: ClockFit | None
    """None: the clocks stay as logged."""
    reference_s: float
    notices: tuple[Notice, ...]

    def moved(self, t_s: Floats) -> Floats:
        """Times of fixes (n,) on the wheels' clock."""
        if self.fit is None:
            return t_s
        return np.asarray(t_s + (self.fit.offset_s + self.fit.skew * (t_s - self.reference_s)))

    def after(self, clock: Clock) -> Clock:
        """Both steps as one clock: how the fixes had their times, and then this."""
        if self.fit is None:
            return clock
        return replace(
            clock,
            source="motion",
            offset_s=clock.offset_s + self.fit.offset_s,
            skew_ppm=clock.skew_ppm + 1e6 * self.fit.skew,
            sigma_offset_s=float(np.hypot(clock.sigma_offset_s, self.fit.sigma_offset_s)),
            sigma_skew_ppm=float(np.hypot(clock.sigma_skew_ppm, 1e6 * self.fit.sigma_skew)),
        )


def clock_by_motion(wheels: WheelPath, fixes: Fixes, span_s: tuple[float, float]) -> MotionClock | None:
    """How far the fixes' clock is off the wheels', or None where the clocks agree or the motion does not tell.

    span_s is what the wheels' stream covers. Raises DataError where the clocks as logged do not overlap and several
    offsets fit equally well.
    """
    if fixes.t_s.size < 2 or wheels.t_s.size < 2:
        return None
    overlap = fixes.t_s[-1] >= span_s[0] and fixes.t_s[0] <= span_s[1]
    lags = find_lags(wheels, fixes)
    if not lags:
        mirrored = wheels.mirrored()
        lags = find_lags(mirrored, fixes)
        if not lags:
            return None
        wheels = mirrored
    near = overlap and _near(lags[0], fixes)
    glance = fit_clock(wheels, fixes, 0.0, rounds=1) if near else None
    if glance is not None and _is_small(glance, fixes):
        return None
    local = fit_clock(wheels, fixes, 0.0) if near else None
    if local is not None and _keeps(local, fixes):
        return None
    if local is not None and abs(local.offset_s) < NEAR_S and local.skew_is_possible:
        as_it_stands = fit_clock(wheels, fixes, 0.0, filters=local.filters, rounds=0)
        if as_it_stands is not None and not _fails_elsewhere(local, as_it_stands):
            return MotionClock(local, fixes.middle_s, (_told(local, fixes, wheels),))
    fits = _fitted(wheels, fixes, lags)
    if not fits:
        return None
    good = _good(fits)
    logged = _as_logged(wheels, fixes, good[0]) if overlap else None
    if logged is not None:
        if not all(_clearly_worse(logged, fit) for fit in good):
            return None
        steady = [
            fit
            for fit in good
            if not _fails_elsewhere(fit, logged)
            and fit.covered > MOST_COVERED * logged.covered
            and fit.skew_is_possible
        ]
        if not steady:
            return MotionClock(None, 0.0, (_disagree_in_part(good[0], fixes),))
        good = steady
    chosen, notices = (good[0], []) if len(good) == 1 else _one_of(good, fixes, span_s, overlap)
    half_s = 0.5 * float(np.ptp(fixes.t_s))
    if not overlap or _mismatch_is_clear(chosen, half_s):
        notices.insert(0, _told(chosen, fixes, wheels))
        return MotionClock(chosen, fixes.middle_s, tuple(notices))
    return None


def small_offset(wheels: WheelPath, fixes: Fixes) -> MotionClock | None:
    """How far two clocks that are thought to agree do: as the motion has it, weighed against how well hosts are set.

    For fixes whose times the logging computer never saw: nobody can say then what is a clock's and what a receiver's.
    None where the motion does not tell.
    """
    if fixes.t_s.size < 2 or wheels.t_s.size < 2:
        return None
    fit = fit_clock(wheels, fixes, 0.0)
    if fit is None or not _keeps(fit, fixes):
        return None
    prior = np.array([LATENCY_S, USUAL_SKEW])
    share = prior**2 / (prior**2 + np.diag(fit.covariance))
    scale = np.sqrt(np.outer(share, share))
    known = replace(fit, offset_s=fit.offset_s * share[0], skew=fit.skew * share[1], covariance=fit.covariance * scale)
    return MotionClock(known, fixes.middle_s, ())


def _near(lag: Lag, fixes: Fixes) -> bool:
    """Whether the lag may be the clocks as logged."""
    return abs(lag.offset_s) <= SAME_S + abs(lag.skew) * 0.5 * float(np.ptp(fixes.t_s))


def _is_small(glance: ClockFit, fixes: Fixes) -> bool:
    """Whether one step of the fit stays far within LATENCY_S."""
    half_s = 0.5 * float(np.ptp(fixes.t_s))
    return max(abs(glance.at(-half_s)[0]), abs(glance.at(half_s)[0])) < 0.5 * LATENCY_S


def _keeps(local: ClockFit, fixes: Fixes) -> bool:
    """Whether the clocks as logged are as good as agreed."""
    return not _mismatch_is_clear(local, 0.5 * float(np.ptp(fixes.t_s)))


def _mismatch_is_clear(fit: ClockFit, half_s: float) -> bool:
    """Whether the clocks disagree, at one end of the run or the other, by more than a latency and than chance."""
    return any(
        abs(off_s) > max(LATENCY_S, CLEAR_SIGMAS * sigma_s) for off_s, sigma_s in (fit.at(-half_s), fit.at(half_s))
    )


def _as_logged(wheels: WheelPath, fixes: Fixes, like: ClockFit) -> ClockFit | None:
    """The clocks as logged, fitted if that stays within a latency, else as they stand; under the same noise."""
    fit = fit_clock(wheels, fixes, 0.0, filters=like.filters)
    if fit is not None and _keeps(fit, fixes):
        return fit
    return fit_clock(wheels, fixes, 0.0, filters=like.filters, rounds=0)


def _fails_elsewhere(found: ClockFit, logged: ClockFit) -> bool:
    """Whether some fixes that fit as logged do not fit at the offset found: then it is not the clocks that are off."""
    common = np.isfinite(found.cost) & np.isfinite(logged.cost)
    if not common.any():
        return False
    usual = float(np.median(np.minimum(found.cost, logged.cost)[common]))
    return bool(((found.cost > MUCH_WORSE * usual) & (logged.cost < found.cost / MUCH_WORSE))[common].any())


def _fitted(wheels: WheelPath, fixes: Fixes, lags: list[Lag]) -> list[ClockFit]:
    """The lags refined, all under the noise of the best of them; distinct ones, most explained first."""
    first = fit_clock(wheels, fixes, lags[0].offset_s, lags[0].skew)
    if first is None:
        return []
    fits = [first]
    for lag in lags[1:MOST_FITTED]:
        fit = fit_clock(wheels, fixes, lag.offset_s, lag.skew, first.filters)
        if fit is not None and all(abs(fit.offset_s - other.offset_s) > SAME_S for other in fits):
            fits.append(fit)
    return [fit for fit in fits if int(np.isfinite(fit.cost).sum()) >= FEWEST_BLOCKS]


def _good(fits: list[ClockFit]) -> list[ClockFit]:
    """Those that are not clearly worse than the best."""
    best = min(fits, key=lambda fit: float(np.nanmean(fit.cost)))
    return [fit for fit in fits if not _clearly_worse(fit, best)]


def _clearly_worse(one: ClockFit, other: ClockFit) -> bool:
    """Whether the innovations of the same fixes are clearly larger under one fit than under the other.

    Fixes that only one of them explains do not count: frozen or disturbed fixes fit nothing, and would be best left
    out. The blocks' scatter is the better fit's alone: a wrong offset may fail in one block, where the robot turned.
    """
    common = np.isfinite(one.cost) & np.isfinite(other.cost)
    if int(common.sum()) < FEWEST_BLOCKS:
        common_one, common_other = np.isfinite(one.cost), np.isfinite(other.cost)
    else:
        common_one = common_other = common
    usual, scatter = float(other.cost[common_other].mean()), float(other.cost[common_other].std(ddof=1))
    error = scatter * np.sqrt(1.0 / common_one.sum() + 1.0 / common_other.sum())
    excess = float(one.cost[common_one].mean()) - usual
    return excess > max(CLEARLY_WORSE * float(error), (WORSE_RATIO - 1.0) * usual)


def _one_of(
    good: list[ClockFit], fixes: Fixes, span_s: tuple[float, float], overlap: bool
) -> tuple[ClockFit, list[Notice]]:
    """Which of several offsets that fit equally well to take, and what to say about it; DataError where none may be."""
    others = ", ".join(f"{fit.offset_s:+.2f} s" for fit in good[:5])
    together = _begins_and_ends_together(good, fixes, span_s)
    what = f"offsets between the clocks fit the motion equally well ({others}): "
    if together is not None:
        what += "taken the one at which both streams begin and end together"
        return together, [Notice("gnss", what, len(good))]
    if not overlap:
        raise DataError(
            f"the fixes and {ENCODER_FILE} share no time as logged, and the drive repeats itself: {len(good)} offsets "
            f"between their clocks fit equally well ({others}): log the receive time before each NMEA line, "
            "or stand still once in a while"
        )
    doubt = f"the clock of the fixes is off, and the drive repeats itself: {others} fit equally well"
    chosen = max(good, key=lambda fit: (round(fit.covered, 2), -abs(fit.offset_s)))
    return chosen, [Notice("gnss", what + "log receive times", len(good), "", "warning", doubt)]


def _begins_and_ends_together(good: list[ClockFit], fixes: Fixes, span_s: tuple[float, float]) -> ClockFit | None:
    """The one fit under which both streams begin and end within TOGETHER_S of each other, if no other comes near."""
    half = 0.5 * float(np.ptp(fixes.t_s))

    def apart(fit: ClockFit) -> float:
        first = fixes.t_s[0] + fit.at(-half)[0] - span_s[0]
        last = fixes.t_s[-1] + fit.at(half)[0] - span_s[1]
        return float(max(abs(first), abs(last)))

    order = sorted(good, key=apart)
    nearest, next_ = apart(order[0]), apart(order[1])
    return order[0] if nearest < TOGETHER_S and next_ > 3.0 * nearest + TOGETHER_S else None


def _disagree_in_part(found: ClockFit, fixes: Fixes) -> Notice:
    what = (
        f"fixes of which part fits the wheels as logged, and part does not (it would at an offset of "
        f"{found.offset_s:+.2f} s, or a stream is frozen or disturbed); clocks left as logged"
    )
    doubt = (
        "part of the fixes does not fit the wheels' motion: one of the streams is shifted in time, frozen or disturbed"
    )
    return Notice("gnss", what, int(fixes.t_s.size), "", "warning", doubt)


def _told(fit: ClockFit, fixes: Fixes, wheels: WheelPath) -> Notice:
    """What was found; a doubt where it is not known well."""
    what = (
        f"fixes put on the wheels' clock by their motion: offset {fit.offset_s:+.3f} ± {fit.sigma_offset_s:.3f} s, "
        f"skew {1e6 * fit.skew:+.0f} ± {1e6 * fit.sigma_skew:.0f} ppm; a latency of the receiver is part of the offset"
    )
    turned = float(wheels.yaw_rad[-1] - wheels.yaw_rad[0]) / float(np.ptp(wheels.t_s))
    heading = abs(np.degrees(turned)) * fit.sigma_offset_s
    doubt = ""
    if fit.sigma_offset_s > KNOWN_S:
        doubt = (
            f"the offset between the clocks is known to ± {fit.sigma_offset_s:.2f} s only: "
            "log receive times, or stop now and then"
        )
    elif heading > KNOWN_HEADING_DEG:
        doubt = (
            f"the offset between the clocks is known to ± {fit.sigma_offset_s:.3f} s, and turning one way that is "
            f"± {heading:.2f}° of the heading offset: log receive times, or turn both ways and stop now and then"
        )
    return Notice("gnss", what, int(fixes.t_s.size), "", "warning", doubt)
