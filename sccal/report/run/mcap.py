"""calibration.mcap: a calibration as messages on the logging computer's clock, to lay over the log in a viewer.

Trajectory, parameters as the forward filter learnt them, and innovations; the topics are told in docs/messages.md.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sccal.arrays import Bools, Floats
from sccal.geodesy import TangentPlane
from sccal.logs.messages.mcap_file import RESULT_LIBRARY
from sccal.logs.messages.write import Stamped, encoded, nanoseconds_of, write_topics
from sccal.results.calibration import Calibration, Trajectory
from sccal.results.converter import document_of, json_text

MAP_FRAME, ROBOT_FRAME = "map", "base_link"


def write_calibration_mcap(c: Calibration, path: Path) -> None:
    """Write the file. Times below zero, which MCAP cannot hold, are moved by whole seconds; its metadata tell it."""
    topics = _topics(c)
    first_ns = min(int(topic.stamp_ns.min()) for topic in topics if topic.stamp_ns.size)
    ahead_ns = -(min(first_ns, 0) // 1_000_000_000) * 1_000_000_000
    if ahead_ns:
        topics = [
            Stamped(one.topic, one.type_name, one.stamp_ns, one.messages, one.stamp_ns + ahead_ns) for one in topics
        ]
    metadata = {
        "run": c.run,
        "vehicle": c.vehicle.name,
        "origin_lat_deg": repr(c.origin.lat_deg),
        "origin_lon_deg": repr(c.origin.lon_deg),
        "origin_alt_m": repr(c.origin.alt_m),
        "log_ahead_ns": str(ahead_ns),
    }
    attached = {"calibration.json": ("application/json", json_text(document_of(c)).encode())}
    write_topics(path, topics, {"sccal.calibration": metadata}, attached, library=RESULT_LIBRARY)


def _topics(c: Calibration) -> list[Stamped]:
    topics = [_odometry("/sccal/odometry", c.trajectory)]
    if c.on_the_way is not None:
        topics.append(_odometry("/sccal/odometry_on_the_way", c.on_the_way))
    topics.append(_positions(c))
    h, r = c.history, c.residuals
    for name, values, sigma in (
        ("radius_right_m", h.radius_right_m, h.sigma_radius_right_m),
        ("radius_left_m", h.radius_left_m, h.sigma_radius_left_m),
        ("track_m", h.track_m, h.sigma_track_m),
        ("heading_offset_deg", np.degrees(h.heading_offset_rad), np.degrees(h.sigma_heading_offset_rad)),
    ):
        topics += [_numbers(name, h.t_s, values), _numbers(f"{name}_sigma", h.t_s, sigma)]
    topics += [
        _vectors("fix_innovation_m", r.fix_t_s, r.fix_east_m, r.fix_north_m),
        _vectors("fix_innovation_m_sigma", r.fix_t_s, r.fix_sigma_east_m, r.fix_sigma_north_m),
        _flags("fix_accepted", r.fix_t_s, r.fix_accepted),
        _numbers("heading_innovation_deg", r.heading_t_s, np.degrees(r.heading_rad)),
        _numbers("heading_innovation_deg_sigma", r.heading_t_s, np.degrees(r.heading_sigma_rad)),
        _flags("heading_accepted", r.heading_t_s, r.heading_accepted),
    ]
    return topics


def _odometry(topic: str, trajectory: Trajectory) -> Stamped:
    """Poses in the tangent plane, x east and y north, with the variances of x, y and yaw."""
    half = 0.5 * trajectory.yaw_rad
    numbers = {
        "pose.pose.position.x": trajectory.east_m,
        "pose.pose.position.y": trajectory.north_m,
        "pose.pose.orientation.z": np.sin(half),
        "pose.pose.orientation.w": np.cos(half),
        "pose.covariance[0]": trajectory.sigma_east_m**2,
        "pose.covariance[7]": trajectory.sigma_north_m**2,
        "pose.covariance[35]": trajectory.sigma_yaw_rad**2,
    }
    texts = {"header.frame_id": MAP_FRAME, "child_frame_id": ROBOT_FRAME}
    return encoded(topic, "nav_msgs/msg/Odometry", trajectory.t_s, texts, {}, numbers)


def _positions(c: Calibration) -> Stamped:
    """The same path as latitude and longitude, for a map."""
    trajectory = c.trajectory
    plane = TangentPlane(c.origin.lat_deg, c.origin.lon_deg, c.origin.alt_m)
    lat_deg, lon_deg = plane.to_lat_lon(trajectory.east_m, trajectory.north_m)
    n = trajectory.t_s.size
    numbers = {
        "latitude": lat_deg,
        "longitude": lon_deg,
        "altitude": np.full(n, c.origin.alt_m),
        "position_covariance[0]": trajectory.sigma_east_m**2,
        "position_covariance[4]": trajectory.sigma_north_m**2,
        "position_covariance_type": np.full(n, 2.0),
    }
    texts = {"header.frame_id": ROBOT_FRAME}
    return encoded("/sccal/position", "sensor_msgs/msg/NavSatFix", trajectory.t_s, texts, {}, numbers)


def _numbers(name: str, t_s: Floats, values: Floats) -> Stamped:
    return encoded(f"/sccal/{name}", "std_msgs/msg/Float64", t_s, {}, {}, {"data": values})


def _vectors(name: str, t_s: Floats, east: Floats, north: Floats) -> Stamped:
    numbers = {"vector.x": east, "vector.y": north}
    frame = {"header.frame_id": MAP_FRAME}
    return encoded(f"/sccal/{name}", "geometry_msgs/msg/Vector3Stamped", t_s, frame, {}, numbers)


def _flags(name: str, t_s: Floats, flags: Bools) -> Stamped:
    messages = [b"\0\1\0\0\1" if flag else b"\0\1\0\0\0" for flag in flags.tolist()]
    return Stamped(f"/sccal/{name}", "std_msgs/msg/Bool", nanoseconds_of(t_s), messages)
