"""How large radii and track come out beside their nominal values, and how far the yaw turns beside the fixes' path.

The turning of the yaw says how the two wheels share it, p and q: dψ = (r / L) (p dr − q dl) with the nominal radius r
and track L. The fixes say how long the path is that wheels of such sizes lay out along the yaw. Together: p β, q β and
β times the nominal right radius, left radius and track. An antenna off the middle is a column of its own in the fit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sccal.align.path import laid_out
from sccal.arrays import Complexes, Floats
from sccal.errors import DataError
from sccal.logs.names import ENCODER_FILE, VEHICLE_FILE
from sccal.logs.streams import Notice

if TYPE_CHECKING:
    from sccal.align.aligned import Aligned

FAR_RADIUS = 1.25
"""A radius so many times larger or smaller than declared is 2.5 sigmas of its prior (10 %) away: worth a look."""
REFUSED_RADIUS = 1.4
"""Neither wear nor load changes a radius as much; a skidding track, which is wider by up to two, is no radius."""
UNEQUAL_RADII = 1.15
"""Ratio of the radii that is 3.5 sigmas of the prior of their difference (4 %) away."""
LOST_RADII = 1.6
"""A ratio of the radii beyond this is no pair of wheels that drives: one of the counters counts otherwise."""
WINDOW_S = 2.0
LONGEST_WINDOW_S = 8.0
CLEAR_SIGMAS = 10.0
"""So far, in sigmas of a fix, the robot ought to go in a window."""
CHUNK_S = 60.0
"""Yaw and fixes are compared over so long, for a yaw may drift or jump."""
FEWEST_WINDOWS = 8
LEAST_TRAVEL_M = 5.0
"""By the wheels in a chunk that is compared."""
LEAST_TURN_RAD = np.radians(120.0)
GOES_WITH = 0.99
"""Correlation of the yaw's steps with what the two wheels explain of them, from which their shares are believed."""
MOST_SHARE_ERROR = 0.05
LITTLE_EXPLAINED = 0.5
"""Share of the fixes' motion that wheels and yaw explain, below which they are of another drive."""
MUCH_EXPLAINED = 0.8
USUAL = 0.85
"""Share of the windows by which a chunk is judged; the others may hold outliers."""
SECOND_DIFFERENCES = np.sqrt(6.0)
"""Standard deviation of second differences for noise of one; the median of a length in two axes is about the same."""
RATE_HZ = 20.0
NOTATIONS = (
    (0.6, "minutes stand where the decimals of degrees should be"),
    (0.36, "degrees, minutes and seconds are packed into one number"),
)
"""Sixty minutes, written as decimals, are 0.60 degrees; sixty seconds behind two digits of minutes 0.0060."""
NOTATION_NEAR = 0.05
FACTORS = np.exp(np.arange(-1.2, 1.21, 0.04))
"""By which a yaw may have to be multiplied: 0.3 to 3.3, each 4 % further."""
LEAST_GAIN = np.log(1.12)
"""A gain nearer to 1 is left to the fit, which measures it better."""
BEYOND_IRON_RAD = np.radians(75.0)
"""A gain adds up over the whole swing; a compass that iron bends by 35 degrees, to either side, errs by no more."""
CLEARLY_WORSE = 3.0


@dataclass(frozen=True)
class Shares:
    """How the wheels share the turning of the yaw: 1 and 1 for nominal sizes."""

    right: float
    left: float
    correlation: float
    sigma: float
    """The larger of the two standard errors."""

    @property
    def clear(self) -> bool:
        """Whether both are known and go with the yaw."""
        known = self.sigma < MOST_SHARE_ERROR * min(abs(self.right), abs(self.left))
        return self.correlation > GOES_WITH and known


@dataclass(frozen=True)
class PathFit:
    """The path of wheels and yaw beside the fixes, the median of some chunks."""

    scale: float
    explained: float
    """Share of the fixes' motion that the path explains."""
    chunks: int


def shares_of_turning(aligned: Aligned) -> Shares | None:
    """The wheels' shares in the turning of the yaw, from steps of WINDOW_S; None where the robot hardly turns."""
    t_s = np.arange(max(aligned.span_s[0], aligned.heading_t_s[0]), aligned.heading_t_s[-1], WINDOW_S)
    if t_s.size < FEWEST_WINDOWS:
        return None
    scale = aligned.vehicle.wheel_radius_m / aligned.vehicle.track_m
    right, left = (
        scale * np.diff(np.interp(t_s, aligned.wheel_t_s, angle)) for angle in (aligned.right_rad, aligned.left_rad)
    )
    yaw = np.diff(np.interp(t_s, aligned.heading_t_s, aligned.yaw_rad))
    if np.abs(yaw).sum() < LEAST_TURN_RAD:
        return None
    x = np.column_stack([right, -left])
    normal = x.T @ x
    if np.linalg.cond(normal) > 1e8:
        return None
    inverse = np.linalg.inv(normal)
    found = inverse @ (x.T @ yaw)
    for _ in range(3):  # A jump of the yaw must not decide.
        off = np.abs(yaw - x @ found)
        weight = 1.0 / np.maximum(off / max(3.0 * float(np.median(off)), 1e-6), 1.0)
        inverse = np.linalg.inv((x * weight[:, None]).T @ x)
        found = inverse @ ((x * weight[:, None]).T @ yaw)
    said = x @ found
    size = float(np.sqrt((said @ said) * (yaw @ yaw)))
    sigma = float(np.sqrt(np.diag(inverse).max() * np.mean(weight * (yaw - said) ** 2)))
    return Shares(float(found[0]), float(found[1]), float(said @ yaw) / size if size > 0.0 else 0.0, sigma)


def _known_shares(aligned: Aligned) -> Shares | None:
    """The same where they are clear and both wheels roll forward."""
    shares = shares_of_turning(aligned)
    return shares if shares is not None and shares.clear and min(shares.right, shares.left) > 0.0 else None


def wheel_turn(aligned: Aligned, t_s: Floats) -> Floats:
    """Turning by the wheels (rad, nominal radius and track) up to each time."""
    difference = aligned.right_rad - aligned.left_rad
    scale = aligned.vehicle.wheel_radius_m / aligned.vehicle.track_m
    return scale * np.interp(t_s, aligned.wheel_t_s, difference)


def fit_of_path(
    aligned: Aligned, right: float = 1.0, left: float = 1.0, yaw_factor: float = 1.0, yaw_rad: Floats | None = None
) -> PathFit | None:
    """How the fixes follow wheels of so many nominal radii along the yaw times a factor; None where little moves.

    ``yaw_rad`` at the wheels' times (n,) stands in for the AHRS where given.
    """
    t_s = window_times(aligned)
    if t_s is None:
        return None
    wheel_t_s, travel, yaw = _thinned(aligned, right, left, yaw_rad)
    path = np.interp(t_s, wheel_t_s, laid_out(travel, yaw_factor * yaw))
    arm = aligned.vehicle.track_m * np.exp(1j * yaw_factor * np.interp(t_s, wheel_t_s, yaw))
    place = np.interp(t_s, aligned.fix_t_s, aligned.steady_place_m)
    columns = np.column_stack([np.diff(path), np.diff(arm)])
    steps: Complexes = np.asarray(np.diff(place), dtype=np.complex128)
    far = np.abs(np.diff(np.interp(t_s, wheel_t_s, travel)))
    number = ((t_s[:-1] - t_s[0]) // CHUNK_S).astype(np.int64)
    found = []
    for k in np.unique(number):
        rows = np.flatnonzero(number == k)
        if rows.size >= FEWEST_WINDOWS - 2 and far[rows].sum() > LEAST_TRAVEL_M:
            found.append(_of_chunk(columns[rows], steps[rows]))
    if not found:
        return None
    scales, explained = zip(*found, strict=True)
    return PathFit(float(np.median(scales)), float(np.median(explained)), len(found))


def _of_chunk(columns: Complexes, steps: Complexes) -> tuple[float, float]:
    """Length of the factor that brings the first column to the steps, and the share of these that is explained."""
    size = np.linalg.norm(columns[:, 0])
    weight = np.ones(steps.size)
    for _ in range(5):  # Single fixes that lie far off must not decide.
        weighted = (columns * weight[:, None]).conj().T
        factor = np.linalg.solve(weighted @ columns + 1e-4 * size**2 * np.eye(2), weighted @ steps)
        off = np.abs(steps - columns @ factor)
        weight = 1.0 / np.maximum(off / max(float(np.median(off)), 1e-9), 1.0)
    usual = off <= np.quantile(off, USUAL)
    left_over = float(np.sum(off[usual] ** 2))
    return float(abs(factor[0])), 1.0 - left_over / max(float(np.sum(np.abs(steps[usual]) ** 2)), 1e-12)


def window_times(aligned: Aligned) -> Floats | None:
    """Edges of windows in which the robot's motion stands out from the noise of the fixes; None where it does not."""
    first, last = max(aligned.heading_t_s[0], aligned.fix_t_s[0]), min(aligned.heading_t_s[-1], aligned.fix_t_s[-1])
    speed = float(np.abs(np.diff(aligned.travel_m)).sum()) / max(float(np.ptp(aligned.wheel_t_s)), 1e-9)
    sigma = max(float(np.median(np.sqrt(aligned.fix_var_east_m2 + aligned.fix_var_north_m2))), _noise_m(aligned))
    window_s = max(WINDOW_S, CLEAR_SIGMAS * sigma / max(speed, 1e-6))
    if window_s > LONGEST_WINDOW_S or last - first < FEWEST_WINDOWS * window_s:
        return None
    return np.arange(first, last, window_s)


def _noise_m(aligned: Aligned) -> float:
    """White noise of the fixes by their second differences, which motion hardly moves."""
    place = aligned.fix_east_m + 1j * aligned.fix_north_m
    bends = np.abs(np.diff(place, n=2))
    return float(np.median(bends)) / SECOND_DIFFERENCES if bends.size else 0.0


def _thinned(aligned: Aligned, right: float, left: float, yaw_rad: Floats | None) -> tuple[Floats, Floats, Floats]:
    """Times, travel of the middle and yaw at no more than RATE_HZ."""
    every = max(1, round(1.0 / (RATE_HZ * max(float(np.median(np.diff(aligned.wheel_t_s))), 1e-6))))
    t_s = aligned.wheel_t_s[::every]
    angle = right * aligned.right_rad[::every] + left * aligned.left_rad[::every]
    yaw = np.interp(t_s, aligned.heading_t_s, aligned.yaw_rad) if yaw_rad is None else yaw_rad[::every]
    return t_s, 0.5 * aligned.vehicle.wheel_radius_m * angle, yaw


def check_gain(aligned: Aligned, yaw_on_wheels: float) -> None:
    """Raise DataError where the yaw turns clearly further or less far than the path of the fixes.

    ``yaw_on_wheels`` is how far the yaw turns beside the wheels with the nominal track; where these agree nothing is
    asked of the fixes. Wheels that skid differ from the yaw as well: the fixes tell which of the two is off.
    """
    if abs(np.log(abs(yaw_on_wheels))) < LEAST_GAIN:
        return
    fits = [fit_of_path(aligned, yaw_factor=float(factor)) for factor in FACTORS]
    left_over = np.array([np.inf if fit is None else 1.0 - fit.explained for fit in fits])
    if not np.isfinite(left_over).all():
        return
    best = int(np.argmin(left_over))
    now = float(left_over[int(np.argmin(np.abs(np.log(FACTORS))))])
    if abs(np.log(FACTORS[best])) < LEAST_GAIN or now < CLEARLY_WORSE * left_over[best]:
        return
    if left_over[best] > 1.0 - MUCH_EXPLAINED:
        return
    gain = 1.0 / float(FACTORS[best])
    if abs(1.0 - 1.0 / gain) * float(np.ptp(aligned.yaw_rad)) < BEYOND_IRON_RAD:
        return
    word = {0.5: "half as far as", 2.0: "twice as far as"}.get(round(2.0 * gain) / 2.0, "")
    shown = f" (about {word} it)" if word and abs(gain - round(2.0 * gain) / 2.0) < 0.05 * gain else ""
    raise DataError(
        f"{aligned.heading_source}: the yaw turns {gain:.2f} times as far as the path of the fixes{shown}, and "
        f"{abs(yaw_on_wheels):.2f} times as far as the wheels with the nominal track: the gain of the gyro or compass "
        "is off, or the yaw is in another unit; correct it, for no heading offset makes up for it"
    )


def check_sides(aligned: Aligned) -> None:
    """Raise DataError where one counter counts so much more than the other that no pair of wheels drives so."""
    shares = _known_shares(aligned)
    if shares is None:
        return
    if abs(np.log(shares.right / shares.left)) > np.log(LOST_RADII):
        raise DataError(f"{ENCODER_FILE}: {_unequal(shares.right / shares.left)}")


def check_proportions(aligned: Aligned) -> None:
    """Raise DataError where radii and track together cannot be what is declared, or fixes follow another drive."""
    shares = _known_shares(aligned)
    if shares is None:
        return
    fit = fit_of_path(aligned, shares.right, shares.left)
    if fit is None:
        return
    if fit.explained < LITTLE_EXPLAINED and fit.chunks > 1:
        raise DataError(
            f"gnss: the fixes do not move together with wheels and yaw, which agree with each other (correlation "
            f"{shares.correlation:.2f}): their path explains {100.0 * max(fit.explained, 0.0):.0f} % of the fixes' "
            "motion. The fixes are of another drive or another robot, shifted in time by more than is searched, or "
            "their coordinates are not latitude and longitude"
        )
    if fit.explained > MUCH_EXPLAINED:
        _check_common_scale(aligned, shares, fit.scale)


def _check_common_scale(aligned: Aligned, shares: Shares, track: float) -> None:
    """Raise DataError where both radii and the track are off by one factor: a unit, and not the robot."""
    radii = np.array([shares.right, shares.left]) * track
    common = float(np.sqrt(radii[0] * radii[1]))
    if abs(np.log(common)) < np.log(REFUSED_RADIUS) or abs(np.log(track / common)) > 0.5 * abs(np.log(common)):
        return
    known = next((text for size, text in NOTATIONS if abs(common / size - 1.0) < NOTATION_NEAR), "")
    notation = (
        f"here it looks as if {known}" if known else "degrees and minutes in one number, another unit, a map's grid"
    )
    raise DataError(
        f"gnss: both radii and the track come out at about the same share of their nominal values "
        f"({radii[0]:.2f}, {radii[1]:.2f} and {track:.2f} times): the scale of the fixes is off, because the "
        f"coordinates are in another notation ({notation}); or, if the track in {VEHICLE_FILE} is wrong as well, "
        "ticks_per_rev or wheel_radius_m is. A straight of measured length tells: the fixes must show its metres"
    )


def proportion_doubts(aligned: Aligned) -> list[Notice]:
    """Doubts about sizes that are far from the nominal ones, for the verdict."""
    shares = _known_shares(aligned)
    if shares is None:
        return []
    ratio = shares.right / shares.left
    if abs(np.log(ratio)) > np.log(UNEQUAL_RADII):
        return [Notice(ENCODER_FILE, f"pair of wheels that differ: {_unequal(ratio)}", 1, "", "warning", _short(ratio))]
    fit = fit_of_path(aligned, shares.right, shares.left)
    if fit is None or fit.explained < MUCH_EXPLAINED:
        return []
    common = float(np.sqrt(shares.right * shares.left)) * fit.scale
    if abs(np.log(common)) < np.log(FAR_RADIUS):
        return []
    doubt = f"the wheels come out at {common:.2f} times their nominal radius: check ticks_per_rev and wheel_radius_m"
    what = (
        f"vehicle whose wheels come out at {common:.2f} times the nominal radius and whose track at {fit.scale:.2f} "
        f"times the nominal one: ticks_per_rev, the counts per turn (gear, quadrature), or wheel_radius_m in "
        f"{VEHICLE_FILE} is wrong, or the coordinates of the fixes are in another notation"
    )
    return [Notice(VEHICLE_FILE, what, 1, "", "warning", doubt)]


def _unequal(ratio: float) -> str:
    side, times = ("left", ratio) if ratio > 1.0 else ("right", 1.0 / ratio)
    return (
        f"the {side} counter counts {times:.2f} times as much as the other one for the same way: the "
        "counts per turn of the wheels differ (ticks_per_rev, gear, quadrature of one side), or one wheel is smaller; "
        "bring both to one ticks_per_rev"
    )


def _short(ratio: float) -> str:
    side, times = ("left", ratio) if ratio > 1.0 else ("right", 1.0 / ratio)
    return f"the {side} counter counts {times:.2f} times as much as the other for the same way: check ticks_per_rev"
