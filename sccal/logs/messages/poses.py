"""Poses in metres as fixes: motion capture, a map's frame, any PoseStamped or PoseWithCovarianceStamped.

x and y are a level frame, counter-clockwise as east and north are, z is up (REP 103). Fixes are latitudes and
longitudes, so the frame is laid on the equator, where it is exact: the first pose at latitude 0, longitude 1. Headings
of the same poses turn with the frame; how the body is turned against the robot is the heading offset.
"""

from __future__ import annotations

import re

import numpy as np

from sccal.arrays import Bools, Floats
from sccal.errors import DataError
from sccal.logs.limits import SIGMA_LIMIT_M
from sccal.logs.messages.heading import has_orientation
from sccal.logs.messages.topics import Messages
from sccal.logs.messages.wheels import of_messages
from sccal.logs.streams import FixStream, Notice
from sccal.logs.timeline import order_in_time

POSE_KINDS = ("PoseStamped", "PoseWithCovarianceStamped")
FRAME_LAT_DEG, FRAME_LON_DEG = 0.0, 1.0
"""Where the first pose is put. Readers of fixes drop latitude 0 with longitude 0."""
SIGMA_M = 0.02
"""Of a pose that states none, to begin with; the log then shows what it is."""
FARTHEST_M = 1e5
"""From the first pose; beyond, the plane is none."""
_WISHES = re.compile(r"goal|target|setpoint|initial|cmd|command|desired|plan|waypoint|reference")
_OF_WHEELS = re.compile(r"odom|amcl|ekf|ukf|filter|fused|pose_update")
"""Topics whose poses are a wish, or may hold the wheels that are to be judged by them."""
_UPRIGHT = np.cos(np.radians(60.0))
_FLAT = 0.1
_SPREAD_M = 0.5
_A_M, _FLATTENING = 6378137.0, 1.0 / 298.257223563


def is_measured(messages: Messages) -> bool:
    """Whether a topic of poses moves, and its name does not say that it is a wish or made of the wheels."""
    name = messages.topic.casefold()
    if _WISHES.search(name) or _OF_WHEELS.search(name):
        return False
    x_m, y_m = messages.column("pose_x_m"), messages.column("pose_y_m")
    known = np.isfinite(x_m + y_m)
    return bool(known.any() and np.ptp(x_m[known]) + np.ptp(y_m[known]) > 0.0)


def turns(messages: Messages) -> bool:
    """Whether measured poses have an orientation that is not always the same one."""
    has = has_orientation(messages)
    return is_measured(messages) and bool(has.any() and np.ptp(messages.column("z")[has]) > 0.0)


def fixes_of_poses(messages: Messages, path: str, source: str) -> tuple[FixStream, tuple[Notice, ...]]:
    """Fixes of a topic of poses.

    Raises:
        DataError: no pose with a position, or a frame whose z is not up.
    """
    x_m, y_m = messages.column("pose_x_m"), messages.column("pose_y_m")
    has = np.isfinite(x_m) & np.isfinite(y_m)
    if not has.any():
        raise DataError(f"{path}: none of {has.size} messages holds a position x, y in metres")
    first = int(np.flatnonzero(has)[0])
    with np.errstate(over="ignore", invalid="ignore"):
        near = has & (np.hypot(x_m - x_m[first], y_m - y_m[first]) <= FARTHEST_M)
    notices = [
        Notice(source, what, int(lost.sum()), f"message {messages.number[lost][0]}", "warning")
        for lost, what in (
            (~has, "messages without a position dropped"),
            (has & ~near, f"poses more than {FARTHEST_M / 1000.0:.0f} km from the first one dropped"),
        )
        if lost.any()
    ]
    origin_m = float(x_m[first]), float(y_m[first])
    messages = messages.keep(near)
    require_level(messages, path)
    order, order_notices = order_in_time(messages.t_s, messages.number, source)
    messages = messages.take(order)
    east_m, north_m = messages.column("pose_x_m") - origin_m[0], messages.column("pose_y_m") - origin_m[1]
    lat_deg, lon_deg = on_the_equator(east_m, north_m)
    sigma_east_m, sigma_north_m, cov_m2, stated = _sigmas(messages)
    told = (
        f"poses read as fixes: x is east and y north of the first pose ({origin_m[0]:.3f}, {origin_m[1]:.3f} m), which "
        f"is put at latitude {FRAME_LAT_DEG:g}, longitude {FRAME_LON_DEG:g}: maps show it in the sea"
    )
    if not stated.all():
        told += f"; their errors are taken as {SIGMA_M:g} m where none are stated"
    stream = FixStream(
        host_t_s=messages.t_s,
        utc_s=np.full(east_m.size, np.nan),
        utc_has_date=False,
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        alt_m=np.full(east_m.size, np.nan),
        quality=np.full(east_m.size, -1, dtype=np.int64),
        sigma_east_m=sigma_east_m,
        sigma_north_m=sigma_north_m,
        cov_en_m2=cov_m2,
    )
    return stream, of_messages((*notices, Notice(source, told, east_m.size), *order_notices))


def on_the_equator(east_m: Floats, north_m: Floats) -> tuple[Floats, Floats]:
    """Latitudes and longitudes (n,) of points of the ellipsoid that lie so far from the tangent plane's origin."""
    b_m = _A_M * (1.0 - _FLATTENING)
    up_m = _A_M * np.sqrt(1.0 - (east_m / _A_M) ** 2 - (north_m / b_m) ** 2)
    lat = np.arctan2(north_m, (1.0 - _FLATTENING) ** 2 * np.hypot(up_m, east_m))
    return FRAME_LAT_DEG + np.degrees(lat), FRAME_LON_DEG + np.degrees(np.arctan2(east_m, up_m))


def require_level(messages: Messages, path: str) -> None:
    """Raise DataError where z is not up: by the bodies' own axes, or by where the poses spread."""
    advice = "let the motion capture write z up (not y), and define the body with z up and x ahead"
    has = has_orientation(messages)
    if has.any():
        x, y, z, w = (messages.column(axis)[has] for axis in "xyzw")
        upright = float(np.median((w**2 + z**2 - x**2 - y**2) / (w**2 + x**2 + y**2 + z**2)))
        if upright < _UPRIGHT:
            tilt_deg = np.degrees(np.arccos(max(upright, -1.0)))
            raise DataError(f"{path}: the z axis of the poses leans by {tilt_deg:.0f} degrees (median): {advice}")
    spread_m = [_spread_m(messages.column(f"pose_{axis}_m")) for axis in "xyz"]
    if spread_m[2] > _SPREAD_M and min(spread_m[:2]) < _FLAT * spread_m[2]:
        shown = ", ".join(f"{size:.2f} m in {axis}" for axis, size in zip("xyz", spread_m, strict=True))
        raise DataError(f"{path}: the poses move by {shown}, so z is not up: {advice}")


def _spread_m(values_m: Floats) -> float:
    known = values_m[np.isfinite(values_m)]
    return float(np.ptp(known)) if known.size else 0.0


def _sigmas(messages: Messages) -> tuple[Floats, Floats, Floats, Bools]:
    """East and north sigmas and their covariance (n,), and where they are stated."""
    var_east, var_north = messages.column("cov_ee"), messages.column("cov_nn")
    stated = (var_east > 0) & (var_north > 0)
    east, north = (np.sqrt(np.where(stated, var, SIGMA_M**2)) for var in (var_east, var_north))
    east, north = np.minimum(east, SIGMA_LIMIT_M), np.minimum(north, SIGMA_LIMIT_M)
    limit = east * north
    cov = np.where(stated, np.clip(np.nan_to_num(messages.column("cov_en")), -limit, limit), 0.0)
    return east, north, cov, stated
