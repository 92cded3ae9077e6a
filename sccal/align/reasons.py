"""Why yaw and wheels do not turn together, as far as the log shows it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sccal.align.counters import FEWEST_FLIPS, flips_of, same_counts
from sccal.align.proportions import MUCH_EXPLAINED, fit_of_path, wheel_turn
from sccal.arrays import Bools, Floats
from sccal.errors import DataError
from sccal.logs.names import ENCODER_FILE

if TYPE_CHECKING:
    from sccal.align.aligned import Aligned

FEWEST_SUMS = 3
STANDS_RAD = np.radians(0.3)
TURNS_RAD = np.radians(4.0)
MOSTLY = 0.5
HELD = 1.0 / 3.0
LATER = 20
"""Steps after which a yaw that was held has caught up."""
GOES_WITH = 0.8
LAGS_S = np.arange(1.0, 60.1, 0.5)
CONFINED_RAD = np.radians(200.0)
"""A compass in a field beyond the earth's reads within half a turn, and some noise."""
ROUND = 1.5
"""Turns by the wheels with the nominal track; those that skid seem to turn up to twice as far as they do."""
NOT_WITH = 0.9


def why_apart(aligned: Aligned, t_s: Floats, wheels_rad: Floats, yaw_rad: Floats, watched: Bools) -> str:
    """A sentence about steps of wheels and yaw (k,) between times (k + 1,) that do not go together."""
    turns = watched & (np.abs(wheels_rad) > TURNS_RAD)
    if same_counts(aligned):
        return (
            "the two counters always count the same, so the robot would never turn: one column is there twice, or it "
            "is no count of a wheel"
        )
    if abs(_correlation(_middle(aligned, t_s)[watched], wheels_rad[watched])) > GOES_WITH:
        return "the yaw itself goes with the turn rate of the wheels: the column is a rate, and no angle"
    flips = watched & flips_of(yaw_rad, wheels_rad)
    if flips.sum() >= FEWEST_FLIPS:
        return (
            f"the yaw flips by 180 degrees {int(flips.sum())} times, first at t = {t_s[:-1][flips][0]:.0f} s, while "
            "the wheels hardly turn: it is a course over ground, which turns round when the robot reverses, and no "
            "heading"
        )
    stands = turns & (np.abs(yaw_rad) < STANDS_RAD)
    held = stands.sum() > HELD * turns.sum() and _goes_with_later(wheels_rad, yaw_rad)
    if held or stands.sum() > MOSTLY * turns.sum():
        return (
            f"the yaw stands still in {int(stands.sum())} of {int(turns.sum())} s in which the wheels turn, first at "
            f"t = {t_s[:-1][stands][0]:.0f} s: the AHRS is frozen, or holds its reading while the robot is slow"
        )
    lag_s, correlation = _best_lag(aligned, t_s, yaw_rad, watched)
    if correlation > GOES_WITH:
        what = "later" if lag_s > 0.0 else "sooner"
        return (
            f"the yaw comes about {abs(lag_s):.1f} s {what} than the wheels turn: one of the streams is shifted in time"
        )
    return (
        "one of the streams is of another drive, frozen, or shifted in time by more than a minute, or the column is no "
        "yaw"
    )


def check_goes_round(aligned: Aligned, correlation: float) -> None:
    """Raise DataError where the robot turns all the way round and the yaw stays within half a turn, moving about."""
    swing, turned = float(np.ptp(aligned.yaw_rad)), float(np.ptp(wheel_turn(aligned, aligned.wheel_t_s)))
    if correlation > NOT_WITH or swing > CONFINED_RAD or turned < ROUND * 2.0 * np.pi:
        return
    by_wheels = fit_of_path(aligned, yaw_rad=wheel_turn(aligned, aligned.wheel_t_s))
    if by_wheels is None or by_wheels.explained < MUCH_EXPLAINED:
        return
    if _stands_mostly(aligned):
        return
    raise DataError(
        f"{aligned.heading_source}: the yaw does not go all the way round when the robot does: it stays within "
        f"{np.degrees(swing):.0f} degrees, while the wheels turn the robot by {np.degrees(turned):.0f}, and the fixes "
        "side with them. A magnet or a current moves along with the compass that is stronger than the field of the "
        f"earth (or {ENCODER_FILE} and the yaw are of different drives): move the compass away from motors and iron"
    )


def _stands_mostly(aligned: Aligned) -> bool:
    t_s = np.arange(aligned.heading_t_s[0], aligned.heading_t_s[-1])
    yaw = np.abs(np.diff(np.interp(t_s, aligned.heading_t_s, aligned.yaw_rad)))
    turns = np.abs(np.diff(wheel_turn(aligned, t_s))) > TURNS_RAD
    return float((yaw[turns] < STANDS_RAD).mean() if turns.any() else 1.0) > MOSTLY


def _goes_with_later(wheels_rad: Floats, yaw_rad: Floats) -> bool:
    """Whether wheels and yaw go together over LATER steps, although not over one."""
    size = wheels_rad.size // LATER * LATER
    if size < FEWEST_SUMS * LATER:
        return False
    sums = (steps[:size].reshape(-1, LATER).sum(axis=1) for steps in (wheels_rad, yaw_rad))
    return _correlation(*sums) > GOES_WITH


def _middle(aligned: Aligned, t_s: Floats) -> Floats:
    return np.interp(0.5 * (t_s[1:] + t_s[:-1]), aligned.heading_t_s, aligned.yaw_rad)


def _best_lag(aligned: Aligned, t_s: Floats, yaw_rad: Floats, watched: Bools) -> tuple[float, float]:
    """The lag of the yaw (s) at which it goes best with the wheels, and the correlation there."""
    best = (0.0, 0.0)
    for lag_s in (*-LAGS_S, *LAGS_S):
        inside = watched & (t_s[:-1] - lag_s >= aligned.span_s[0]) & (t_s[1:] - lag_s <= aligned.span_s[1])
        if inside.sum() > MOSTLY * watched.sum():
            found = _correlation(np.diff(wheel_turn(aligned, t_s - lag_s))[inside], yaw_rad[inside])
            best = max(best, (float(lag_s), found), key=lambda one: one[1])
    return best


def _correlation(x: Floats, y: Floats) -> float:
    a, b = x - x.mean(), y - y.mean()
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if size > 0.0 else 0.0
