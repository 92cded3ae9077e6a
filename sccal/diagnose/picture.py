"""Residuals against their cause, as points to draw: binned medians before and after an effect is in the model.

At the heading and the fixes a residual is what the final pass leaves there, plus (for "before") what the effect adds:
a partial residual. At the motion it is plainer: over windows of some seconds, turning by the AHRS less turning by the
wheels, or distance by the fixes less distance by the wheels, with the constants of either model.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Bools, Floats
from sccal.effects.effect import Column
from sccal.effects.logged import LoggedColumn
from sccal.effects.view import DriveView, Moments
from sccal.evidence.extension import Free, FreeEffects, view_run
from sccal.evidence.model import Model
from sccal.results.diagnosis import Picture

BINS = 24
LEAST = 3
"""Values in a bin that is drawn."""
MOTION_WINDOW_S = 5.0
STANDING_MPS = 0.05
NORMAL_MAD = 1.4826
UNSURE = 5.0
"""Bins whose error is so many times the usual are not drawn: they would only stretch the axis."""


@dataclass(frozen=True)
class Windows:
    """The robot in stretches of its drive: means over each, and where it is in the middle."""

    t_s: Floats
    speed_mps: Floats
    turn_rate_radps: Floats
    acceleration_mps2: Floats
    yaw_rad: Floats
    east_m: Floats
    north_m: Floats


Quantity = Callable[[DriveView, Moments | Windows], Floats]


@dataclass(frozen=True)
class Cause:
    """What a residual is drawn against."""

    label: str
    of: Quantity


def _heading_deg(_: DriveView, at: Moments | Windows) -> Floats:
    return np.asarray(np.degrees(at.yaw_rad) % 360.0)


def _time_s(view: DriveView, at: Moments | Windows) -> Floats:
    return at.t_s - view.start_s


HEADING = Cause("heading of the robot, deg", _heading_deg)
SPEED = Cause("speed, m/s", lambda _, at: at.speed_mps)
TURN_RATE = Cause("turn rate, deg/s", lambda _, at: np.asarray(np.degrees(at.turn_rate_radps)))
ACCELERATION = Cause("acceleration, m/s²", lambda _, at: at.acceleration_mps2)
TIME = Cause("time since the start, s", _time_s)
PITCH = Cause("pitch, deg", lambda v, at: np.degrees(np.interp(at.t_s, v.steps.t_s, v.steps.pitch_rad)))
ROLL = Cause("roll, deg", lambda v, at: np.degrees(np.interp(at.t_s, v.steps.t_s, v.steps.roll_rad)))
EAST = Cause("east, m", lambda _, at: at.east_m)

_CAUSES: dict[str, Cause] = {
    "heading": HEADING,
    "speed": SPEED,
    "turn_rate": TURN_RATE,
    "acceleration": ACCELERATION,
    "time": TIME,
    "pitch": PITCH,
    "roll": ROLL,
    "east": EAST,
}


def cause_of(free: Free) -> Cause:
    """The quantity that shows an effect best, which the effect itself says."""
    effect = free.effect
    if isinstance(effect, LoggedColumn):
        column = effect.column
        return Cause(column, lambda view, at: view.logged_at(column, at.t_s))
    return _CAUSES[effect.shown_against]


def picture_of(before: Model, after: Model, free: Free, runs: list[int]) -> Picture | None:
    """The residual of some runs against an effect's cause; None where nothing can be drawn."""
    cause = cause_of(free)
    drawn: list[_Part | None] = []
    for run in runs:
        values = _values(after, run, free)
        if values is None:
            continue
        port = _port(after, run, free, values)
        if port in ("heading", "antenna_forward", "antenna_left", "east", "north"):
            drawn.append(_at_measurements(after, run, free, values, port, cause))
        else:
            drawn.append(_over_windows(before, after, run, cause, "turn" if port == "turn" else "along"))
    parts = [part for part in drawn if part is not None]
    if not parts:
        return None
    x, was, is_now, model = (np.concatenate([part[k] for part in parts]) for k in range(4))
    return _binned(cause.label, parts[0][4], x, was, is_now, model)


def _values(model: Model, run: int, free: Free) -> list[float] | None:
    known = model.values(run)
    wanted = [(free.key, one.name) for one in free.parameters]
    return [known[name] for name in wanted] if set(wanted) <= set(known) else None


def _port(model: Model, run: int, free: Free, values: list[float]) -> str:
    columns = _columns(model, run, free, values)[1]
    return columns[0].port if columns else ""


def _columns(model: Model, run: int, free: Free, values: list[float]) -> tuple[DriveView, list[Column]]:
    problem, at = model.problems[run], model.at(run)
    view = view_run(problem, at, problem.clear_steps(at.constants))
    placed = free.placed(view, values, 0)
    return view, [one.column for one in placed]  # type: ignore[misc]


_Part = tuple[Floats, Floats, Floats, Floats, str]


def _at_measurements(model: Model, run: int, free: Free, values: list[float], port: str, cause: Cause) -> _Part | None:
    """Partial residuals at the heading readings (deg) or at the fixes (m)."""
    view, columns = _columns(model, run, free, values)
    number = {one.name: value for one, value in zip(free.parameters, values, strict=True)}
    path = model.path(run)
    if port == "heading":
        added = sum(number[one.parameter] * one.values for one in columns)
        good: Bools = path.heading_accepted
        left = np.degrees(path.heading_nu_rad)
        x = cause.of(view, view.headings)
        return x[good], (left + np.degrees(added))[good], left[good], np.degrees(added)[good], "heading residual, deg"
    forward = np.zeros(view.fixes.t_s.size)
    east = np.zeros(view.fixes.t_s.size)
    north = np.zeros(view.fixes.t_s.size)
    c, s = np.cos(view.fixes.yaw_rad), np.sin(view.fixes.yaw_rad)
    for one in columns:
        size = number[one.parameter] * one.values
        forward = forward + (size if one.port == "antenna_forward" else 0.0)
        if one.port == "antenna_forward":
            east, north = east + c * size, north + s * size
        elif one.port == "antenna_left":
            east, north = east - s * size, north + c * size
        elif one.port == "east":
            east = east + size
        else:
            north = north + size
    good = path.fix_accepted
    nu = path.fix_nu_m
    x = cause.of(view, view.fixes)
    if cause is HEADING or port in ("east", "north"):
        axis, label = (east, "east residual of the fixes, m")
        left = nu[:, 0]
        if port == "north" or (port == "east" and np.ptp(north) > np.ptp(east)):
            axis, left, label = north, nu[:, 1], "north residual of the fixes, m"
    elif port == "antenna_left":
        axis, left, label = -s * east + c * north, -s * nu[:, 0] + c * nu[:, 1], "fixes beside the path, m"
    else:
        axis, left, label = forward, c * nu[:, 0] + s * nu[:, 1], "fixes ahead of the path, m"
    return x[good], (left + axis)[good], left[good], axis[good], label


def _over_windows(before: Model, after: Model, run: int, cause: Cause, port: str) -> _Part | None:
    """Turning (deg/s) or distance (mm/m) that the wheels do not account for, per window."""
    problem = after.problems[run]
    aligned = problem.aligned
    first, last = aligned.span_s
    edges = np.arange(max(first, problem.start.moving_from_s), last, MOTION_WINDOW_S)
    if edges.size < LEAST * 2:
        return None
    view = view_run(problem, after.at(run), problem.clear_steps(after.at(run).constants))
    middles = 0.5 * (edges[1:] + edges[:-1])
    seen = view.headings

    def rate(each: Floats) -> Floats:
        return np.asarray(np.diff(np.interp(edges, view.steps.t_s, np.cumsum(each))) / MOTION_WINDOW_S)

    at = Windows(
        t_s=middles,
        speed_mps=rate(view.steps.along_m),
        turn_rate_radps=rate(view.steps.turn_rad),
        acceleration_mps2=rate(view.steps.acceleration_mps2 * view.steps.dt_s),
        yaw_rad=np.interp(middles, seen.t_s, seen.yaw_rad),
        east_m=np.interp(middles, seen.t_s, seen.east_m),
        north_m=np.interp(middles, seen.t_s, seen.north_m),
    )
    residuals = [_window_residual(model, run, edges, port) for model in (before, after)]
    moving = np.abs(at.speed_mps) > STANDING_MPS
    if port == "turn":
        moving |= np.abs(at.turn_rate_radps) > STANDING_MPS
    label = "turning the wheels do not account for, deg/s" if port == "turn" else "distance the wheels miss, mm per m"
    x = cause.of(view, at)
    good = moving & np.isfinite(residuals[0]) & np.isfinite(residuals[1])
    return x[good], residuals[0][good], residuals[1][good], (residuals[0] - residuals[1])[good], label


def _window_residual(model: Model, run: int, edges: Floats, port: str) -> Floats:
    problem, at = model.problems[run], model.at(run)
    aligned, timeline = problem.aligned, problem.timeline
    view = view_run(problem, at, None)
    predicted_turn, predicted_along = view.steps.turn_rad.copy(), view.steps.along_m.copy()
    extension = problem.extension
    if isinstance(extension, FreeEffects):
        for one in extension.laid(view, at.values).placed:
            column = one.column
            size = float(at.values[one.parameter]) * column.values
            if column.port == "turn":
                predicted_turn = predicted_turn + size
            elif column.port == "along":
                predicted_along = predicted_along + size
            elif column.port in ("right_wheel", "left_wheel"):
                predicted_along = predicted_along + 0.5 * size
                sign = 1.0 if column.port == "right_wheel" else -1.0
                predicted_turn = predicted_turn + sign * size / at.constants.track_m
    if port == "turn":
        seen = np.diff(np.interp(edges, aligned.heading_t_s, aligned.yaw_rad))
        by_wheels = np.diff(np.interp(edges, timeline.t_s, np.cumsum(predicted_turn)))
        return np.asarray(np.degrees(seen - by_wheels) / MOTION_WINDOW_S)
    # Distance along the heading between the window's ends, by the fixes and by the wheels.
    yaw = np.interp(timeline.t_s, view.headings.t_s, view.headings.yaw_rad)
    steps = predicted_along * np.exp(1j * yaw)
    by_wheels_m = np.diff(np.interp(edges, timeline.t_s, np.cumsum(steps)))
    by_fixes_m = np.diff(np.interp(edges, aligned.fix_t_s, aligned.fix_east_m + 1j * aligned.fix_north_m))
    distance = np.diff(np.interp(edges, timeline.t_s, np.cumsum(np.abs(view.steps.along_m))))
    ahead = (by_fixes_m - by_wheels_m) * np.conj(by_wheels_m) / np.maximum(np.abs(by_wheels_m), 1e-9)
    return np.asarray(1000.0 * ahead.real / np.where(distance > MOTION_WINDOW_S * STANDING_MPS, distance, np.nan))


def _binned(x_label: str, y_label: str, x: Floats, was: Floats, is_now: Floats, model: Floats) -> Picture | None:
    good = np.isfinite(x) & np.isfinite(was) & np.isfinite(is_now)
    x, was, is_now, model = x[good], was[good], is_now[good], model[good]
    if x.size < 2 * LEAST or np.ptp(x) <= 0.0:
        return None
    low, high = np.quantile(x, [0.005, 0.995])
    place = np.clip(((x - low) / max(high - low, 1e-12) * BINS).astype(int), 0, BINS - 1)
    rows = [np.flatnonzero(place == k) for k in range(BINS)]
    rows = [row for row in rows if row.size >= LEAST]
    if len(rows) < 2:
        return None

    def mean(values: Floats) -> Floats:
        return np.array([float(np.median(values[row])) for row in rows])

    def error(values: Floats) -> Floats:
        spread = [float(np.median(np.abs(values[row] - np.median(values[row])))) for row in rows]
        return np.array([NORMAL_MAD * one / np.sqrt(row.size) for one, row in zip(spread, rows, strict=True)])

    errors = error(was)
    known = errors <= UNSURE * float(np.median(errors))
    rows = [row for row, good in zip(rows, known, strict=True) if good]
    return Picture(x_label, y_label, mean(x), mean(was), error(was), mean(is_now), error(is_now), mean(model))
