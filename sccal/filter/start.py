"""Where the robot stands and heads at the beginning, from the data.

The wheels' signed travel laid out along the AHRS yaw is the path up to a turn, a scale and a shift; the fixes show the
path itself. In complex numbers, fixes z = α p + c: the angle of α is minus the heading offset, its length the scale of
the wheels. Signed travel makes a start in reverse as good as any other. The window grows from the first motion until
the angle is sure, so the zero of the AHRS may be anything and the robot may stand first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sccal.align import Aligned
from sccal.align.signs import slope_through_origin
from sccal.arrays import Complexes, Floats
from sccal.errors import DataError
from sccal.logs.streams import Vehicle

FIRST_WINDOW_S = 10.0
GROWTH = 1.6
ENOUGH_RAD = np.radians(1.0)
PATIENCE_S = 30.0
"""After this long, a less sure start is better than one that uses up the run."""
MIN_SPREAD_M = 1.0
HARDLY_M = 0.3
UNSURE_RAD = 0.7
CORRELATION_S = 3.0
HEADING_FLOOR_RAD = np.radians(3.0)
HUBER = 1.5
PHASE_CENTRE_M = 0.01
ODD_SCALE = 0.15
"""Beyond this the wheels' declared scale, not their wear, is wrong."""
MUCH_UNSURER = 2.0
CHORD_S = 2.0
STRAIGHT_RAD = 0.2
"""Of turning within a chord, which is then shorter than its arc by less than a per cent."""
CLEAR_CHORD = 10.0
"""In sigmas of a fix."""
FEWEST_CHORDS = 12


@dataclass(frozen=True)
class Constants:
    """Values of the vehicle's constants that a pass starts from."""

    radius_right_m: float
    radius_left_m: float
    track_m: float

    @classmethod
    def nominal(cls, vehicle: Vehicle) -> Constants:
        return cls(vehicle.wheel_radius_m, vehicle.wheel_radius_m, vehicle.track_m)

    @classmethod
    def of(cls, values: Floats) -> Constants:
        """From R_r, R_l, L, whatever follows them."""
        return cls(float(values[0]), float(values[1]), float(values[2]))

    def as_array(self) -> Floats:
        return np.array([self.radius_right_m, self.radius_left_m, self.track_m])


@dataclass(frozen=True)
class Start:
    """Pose at the first event, heading offset, and how sure they are."""

    east_m: float
    north_m: float
    yaw_rad: float
    offset_rad: float
    sigma_position_m: float
    sigma_yaw_rad: float
    wheel_scale: float
    """Travel by the fixes over travel by the wheels with the nominal radius, over all of the run's straights."""
    moving_from_s: float
    until_s: float
    """End of the stretch that the pose and the offset rest on; nothing later was used for them."""


def find_start(aligned: Aligned) -> Start:
    """The start of one run. Raises DataError where the robot hardly moves."""
    travel = aligned.travel_m
    turned_m = 0.5 * aligned.vehicle.wheel_radius_m * (aligned.right_rad - aligned.left_rad)
    path = aligned.path_along_yaw
    fixes = aligned.fix_east_m + 1j * aligned.fix_north_m
    path_at_fixes = np.interp(aligned.fix_t_s, aligned.wheel_t_s, path)
    sigma = np.sqrt(aligned.fix_var_east_m2 + aligned.fix_var_north_m2)

    moved = np.abs(travel - travel[0]) + np.abs(turned_m - turned_m[0])
    begins = np.flatnonzero(moved > 0.05)
    moving_from = float(aligned.wheel_t_s[begins[0]]) if begins.size else aligned.span_s[1]
    first, last = aligned.span_s
    length = FIRST_WINDOW_S
    fit, used = None, (moving_from, aligned.fix_t_s[0])
    while True:
        until = moving_from + length
        rows = np.flatnonzero((aligned.fix_t_s <= until) & (aligned.fix_t_s >= moving_from - FIRST_WINDOW_S))
        if rows.size >= 5:
            wider = _similarity(path_at_fixes[rows], fixes[rows], sigma[rows], aligned.fix_t_s[rows])
            # A heading that iron bends fits worse the more of the drive is looked at.
            if fit is None or fit.spread_m <= MIN_SPREAD_M or wider.sigma_angle < MUCH_UNSURER * fit.sigma_angle:
                fit, used = wider, (until, aligned.fix_t_s[rows[0]])
            if fit.sigma_angle < ENOUGH_RAD * max(1.0, length / PATIENCE_S) and fit.spread_m > MIN_SPREAD_M:
                break
        if until >= last:
            break
        length *= GROWTH
    if fit is None or fit.reach_m < HARDLY_M or fit.sigma_angle > UNSURE_RAD:
        total = float(np.abs(np.diff(travel)).sum())
        raise DataError(
            f"the robot hardly moves, or the fixes do not follow it: the wheels travel {total:.2f} m in "
            f"{last - first:.0f} s, and the fixes do not show in which direction; drive at least 10 m, and check that "
            "the receiver's positions change"
        )
    offset = -float(np.angle(fit.alpha))
    yaw_first = float(np.interp(first, aligned.heading_t_s, aligned.yaw_rad))
    until, used_from = used
    driven_before = float(np.abs(np.diff(travel[aligned.wheel_t_s <= used_from])).sum())
    position = fit.alpha * (path[0] - fit.path_mean) + fit.fix_mean
    return Start(
        east_m=float(position.real),
        north_m=float(position.imag),
        yaw_rad=yaw_first - offset,
        offset_rad=float(np.arctan2(np.sin(offset), np.cos(offset))),
        sigma_position_m=float(3.0 * fit.rms_m + np.median(sigma) + 0.1 + 0.05 * driven_before),
        sigma_yaw_rad=float(
            np.sqrt(HEADING_FLOOR_RAD**2 + (2 * fit.sigma_angle) ** 2 + min(fit.rms_m / fit.spread_m, 1.0) ** 2)
        ),
        wheel_scale=_scale_of_chords(aligned) or float(np.abs(fit.alpha)),
        moving_from_s=moving_from,
        until_s=min(until, last),
    )


def _scale_of_chords(aligned: Aligned) -> float | None:
    """Metres by the fixes per metre by the wheels over stretches that the wheels drive straight, whatever the heading.

    The median, None where there are few.
    """
    first, last = max(aligned.span_s[0], aligned.fix_t_s[0]), min(aligned.span_s[1], aligned.fix_t_s[-1])
    t_s = np.arange(first, last, CHORD_S)
    if t_s.size <= FEWEST_CHORDS:
        return None
    vehicle = aligned.vehicle
    travel = np.abs(np.diff(np.interp(t_s, aligned.wheel_t_s, aligned.travel_m)))
    turn = np.diff(np.interp(t_s, aligned.wheel_t_s, aligned.right_rad - aligned.left_rad))
    turn *= vehicle.wheel_radius_m / vehicle.track_m
    place = np.interp(t_s, aligned.fix_t_s, aligned.fix_east_m + 1j * aligned.fix_north_m)
    sigma_m = float(np.median(np.sqrt(aligned.fix_var_east_m2 + aligned.fix_var_north_m2)))
    chord = np.abs(np.diff(place))
    clear = (np.abs(turn) < STRAIGHT_RAD) & (chord > CLEAR_CHORD * sigma_m) & (travel > 0.0)
    if clear.sum() < FEWEST_CHORDS:
        return None
    return float(np.median(chord[clear] / travel[clear]))


def first_constants(aligned: Aligned, start: Start) -> Constants:
    """Nominal values, unless the start already shows that the wheels' scale is far off: the centre of the priors.

    A wrong gear ratio or a radius in inches is no reason for a wrong answer, only for a status and a warning.
    """
    vehicle = aligned.vehicle
    if abs(start.wheel_scale - 1.0) <= ODD_SCALE:
        return Constants.nominal(vehicle)
    radius = vehicle.wheel_radius_m * start.wheel_scale
    return Constants(radius, radius, vehicle.track_m)


def coarse_constants(aligned: Aligned, start: Start) -> Constants:
    """Radii and track near enough to linearise at: the start's scale, and the AHRS's turning over the wheels'."""
    vehicle = aligned.vehicle
    scale = start.wheel_scale
    t_s = np.arange(max(aligned.span_s[0], aligned.heading_t_s[0]), min(aligned.span_s[1], aligned.heading_t_s[-1]))
    wheels = np.diff(np.interp(t_s, aligned.wheel_t_s, aligned.right_rad - aligned.left_rad))
    wheels *= scale * vehicle.wheel_radius_m / vehicle.track_m
    yaw = np.diff(np.interp(t_s, aligned.heading_t_s, aligned.yaw_rad))
    turning = slope_through_origin(wheels, yaw)
    narrower = turning.value if turning.clear and np.abs(wheels).sum() > np.pi else 1.0
    radius = scale * vehicle.wheel_radius_m
    return Constants(radius, radius, vehicle.track_m / float(np.clip(narrower, 0.4, 2.5)))


@dataclass(frozen=True)
class _Similarity:
    alpha: complex
    path_mean: complex
    fix_mean: complex
    rms_m: float
    spread_m: float
    """Of the path as the fixes show it, each as far as it is trusted."""
    reach_m: float
    """The same with all fixes alike: good ones may all be from before the robot moved."""
    sigma_angle: float


def _similarity(path: Complexes, fixes: Complexes, sigma_m: Floats, t_s: Floats) -> _Similarity:
    """z = α (p − p̄) + z̄ by reweighted least squares, and how sure the angle of α is."""
    base = 1.0 / sigma_m**2
    weight = base.copy()
    for _ in range(5):
        total = weight.sum()
        path_mean = complex((weight * path).sum() / total)
        fix_mean = complex((weight * fixes).sum() / total)
        p = path - path_mean
        z = fixes - fix_mean
        power = float((weight * np.abs(p) ** 2).sum())
        alpha = complex((weight * np.conj(p) * z).sum() / power) if power > 0 else 1.0 + 0.0j
        residual = np.abs(z - alpha * p)
        scale = max(float(np.median(residual / sigma_m)), 1e-3)
        weight = base / np.maximum(residual / (HUBER * scale * sigma_m), 1.0)
    rms = float(np.sqrt((weight * residual**2).sum() / total))
    spread = float(np.sqrt((weight * np.abs(p) ** 2).sum() / total))
    independent = max(2.0, min(path.size / 2.0, float(np.ptp(t_s)) / CORRELATION_S))
    # The scatter tells; what the receiver states, or a table for it, counts only where the scatter cannot: few fixes.
    noise = max(rms, float(np.sqrt(1.0 / base.mean())) / path.size, PHASE_CENTRE_M)
    moved = abs(alpha) * spread
    reach = abs(alpha) * float(np.std(path))
    sigma = noise / (max(moved, 1e-6) * math.sqrt(independent))
    return _Similarity(alpha, path_mean, fix_mean, rms, moved, reach, sigma)
