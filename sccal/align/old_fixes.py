"""Fixes that repeat the last position while the wheels go on: old ones, sent again.

A receiver may output faster than it solves, or hold its position below some speed. What it then sends is where the
robot was, with a new time; taken as measured, it is a latency that comes and goes, and noise that is none. Honest
fixes repeat too where the digits are coarse, or by chance where the noise is as coarse as the digits. With white noise
σ, steps q and a displacement d between two fixes, chance gives the same digits in both axes with

    p = q² / (4π σ²) · exp(−d² / 4σ²)  ≤  0.12 (q / d)²        whatever σ is

so a position that is repeated to the last digit is old where the robot has moved by many steps, or by more than the
noise is stated to be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sccal.align.accuracy import FLOOR_M
from sccal.arrays import Bools, Complexes, Floats
from sccal.logs.streams import Notice

STEPS_AT_LEAST = 2.0
"""A robot that crosses a cell of the digits' grid along its diagonal and by a little noise may stay in it so long."""
STEPS_ENOUGH = 10.0
"""Then p ≤ 0.1 %: one honest fix in a thousand is lost at the worst."""
SIGMAS_ENOUGH = 3.0
"""Then exp(−d² / 4σ²) ≤ 0.1, and with q² / 4πσ² ≤ 0.1 where the steps are no coarser than σ, p ≤ 1 %."""
MORE_THAN_CHANCE = 0.01
"""Of all fixes: where so many are old the receiver does repeat itself, also where the robot turns in place or stops."""
FROZEN_S = 10.0
FROZEN_M = 2.0
"""Over so long and so far no receiver holds its position or waits for its next solution: it does not measure."""


@dataclass(frozen=True)
class OldFixes:
    """Which of n fixes are old, and what is to be said about it."""

    old: Bools
    notices: tuple[Notice, ...]


def telling(t_s: Floats, places: Complexes) -> Bools:
    """Which fixes (n,) to compare clocks by: of a repeated place the first, the last, and one in each doubling since.

    A held position says that nothing moves, and no more the hundredth time; its silence is not the noise of the others.
    """
    if t_s.size == 0:
        return np.zeros(0, dtype=np.bool_)
    new = np.concatenate(([True], places[1:] != places[:-1]))
    run = np.cumsum(new) - 1
    since_s = t_s - t_s[new][run]
    octave = np.floor(np.log2(np.maximum(since_s, 0.5)))
    later = np.concatenate(([False], (np.diff(octave) > 0) & (octave[1:] >= 0)))
    return np.asarray(new | later | np.concatenate((new[1:], [True])))


def find_old(t_s: Floats, places: Complexes, path_m: Complexes, step_m: float, sigma_m: Floats) -> OldFixes:
    """Fixes at increasing times (n,) whose places (n,), compared to the last digit, stay while the path (n,) goes on.

    Parameters
    ----------
    t_s
        Times on the wheels' clock.
    places
        As logged, in any unit: only whether they are the same matters.
    path_m
        Where wheels and yaw take the robot, east + i north, up to a turn and a shift.
    step_m
        The digits' resolution.
    sigma_m
        Of the fixes, per axis, as stated or by their quality.
    """
    old = np.zeros(t_s.size, dtype=np.bool_)
    if t_s.size < 2:
        return OldFixes(old, ())
    first = np.flatnonzero(np.concatenate(([True], places[1:] != places[:-1])))
    counts = np.diff(np.append(first, t_s.size))
    run = np.repeat(np.arange(first.size), counts)
    gone_m = np.abs(path_m - path_m[first][run])
    farthest_m = np.maximum.reduceat(gone_m, first)
    enough_m = np.minimum(SIGMAS_ENOUGH * sigma_m[first], np.maximum(STEPS_ENOUGH * step_m, FLOOR_M))
    held = farthest_m > np.maximum(enough_m, max(STEPS_AT_LEAST * step_m, FLOOR_M))
    old[:] = held[run]
    old[first] = False
    if not old.any():
        return OldFixes(old, ())
    if old.mean() > MORE_THAN_CHANCE:
        old[:] = True
        old[first] = False
    lasted_s = t_s[first + counts - 1] - t_s[first]
    longest = int(np.argmax(np.where(held, lasted_s, -1.0)))
    what = (
        f"fixes that repeat the position before to the last digit while the wheels go on (for up to "
        f"{lasted_s[held].max():.1f} s and {farthest_m[held].max():.2f} m) not used: the receiver sends faster than it "
        "solves, or holds its position"
    )
    doubt = ""
    if lasted_s[longest] >= FROZEN_S and farthest_m[longest] > FROZEN_M:
        doubt = (
            f"fixes and wheels do not move together: one position is repeated for {lasted_s[longest]:.0f} s while the "
            f"wheels go {farthest_m[longest]:.0f} m"
        )
    where = f"t = {t_s[int(np.flatnonzero(old & held[run])[0])]:.1f} s"
    return OldFixes(old, (Notice("gnss", what, int(old.sum()), where, "warning", doubt),))
