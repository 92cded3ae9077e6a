"""Effects injected into a log without noise, and what the filter makes of it with the truth held fixed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from sccal.align import Aligned, Clock, Timeline, build_timeline
from sccal.arrays import Floats
from sccal.effects.catalogue import CATALOGUE
from sccal.effects.view import Belief, DriveView, view_drive
from sccal.filter import kernel, layout
from sccal.filter.columns import Placed, kernel_columns
from sccal.filter.forward import Filter
from sccal.filter.layout import BASE_STATES
from sccal.filter.options import FilterOptions
from sccal.filter.start import Constants
from sccal.geodesy import TangentPlane
from sccal.logs.streams import Vehicle
from sccal.results.noise import Noise
from sccal.simulate.choose import settings_from
from sccal.simulate.run import SimulatedRun, simulate_run

NOISELESS = (
    "vehicle.slip_m_per_sqrt_m=0",
    "encoder.ticks_per_rev=100000000",
    "encoder.rate_hz=100",
    "ahrs.rate_hz=20",
    "ahrs.drift_sigma_deg=0",
    "ahrs.white_sigma_deg=0",
    "ahrs.resolution_deg=0.0000001",
    "ahrs.tilt_sigma_deg=0",
    "gnss.white_sigma_m=0",
    "gnss.drift_sigma_m=0",
    "gnss.receive_delay_s=0",
    "gnss.receive_jitter_s=0",
)
NOISE = Noise(1e-3, 0.0, 10.0, 1.0, 0.0, 10.0, 0.0, "given")


@dataclass(frozen=True)
class Injected:
    """A noiseless log with an effect in it, aligned, and the truth about it."""

    simulated: SimulatedRun
    aligned: Aligned
    timeline: Timeline
    view: DriveView


@cache
def injected(effect: str, values: tuple[float, ...], path: str = "general", duration_s: float = 120.0) -> Injected:
    """``effect`` with its parameters' values in order, driven along ``path``."""
    chosen = settings_from([f"drive.path={path}", f"drive.duration_s={duration_s}", *NOISELESS], 11)
    one = CATALOGUE[effect]
    named = dict(zip((p.name for p in one.parameters), values, strict=True))
    simulated = simulate_run(chosen, [one.physics(named)] if any(values) else [])
    aligned = _aligned(simulated)
    timeline = build_timeline(aligned, output_rate_hz=1.0, heading_rate_hz=np.inf, fix_rate_hz=np.inf)
    motion, vehicle = simulated.motion, chosen.vehicle
    start = chosen.clock.start_utc_s - chosen.clock.host_epoch_offset_s
    belief = Belief(
        vehicle.radius_right_m,
        vehicle.radius_left_m,
        vehicle.track_m,
        motion.t_s + start,
        motion.yaw_rad,
        motion.east_m,
        motion.north_m,
    )
    return Injected(simulated, aligned, timeline, view_drive(aligned, timeline, belief))


def _aligned(simulated: SimulatedRun) -> Aligned:
    """The simulator's own arrays, with no rounding by files and no alignment of clocks in between."""
    settings = simulated.settings
    vehicle = settings.vehicle
    encoder, ahrs, gnss = simulated.encoder, simulated.ahrs, simulated.gnss
    plane = TangentPlane(settings.gnss.origin_lat_deg, settings.gnss.origin_lon_deg, settings.gnss.alt_m)
    east, north = plane.to_east_north(gnss.lat_deg, gnss.lon_deg)
    unit = 2.0 * np.pi / settings.encoder.ticks_per_rev
    right, left = unit * encoder.right_ticks, unit * encoder.left_ticks
    inside = (gnss.host_t_s >= encoder.host_t_s[0]) & (gnss.host_t_s <= encoder.host_t_s[-1])
    seen = (ahrs.host_t_s >= encoder.host_t_s[0]) & (ahrs.host_t_s <= encoder.host_t_s[-1])
    count = int(inside.sum())
    return Aligned(
        name="injected",
        vehicle=Vehicle(vehicle.name, Path(), vehicle.nominal_radius_m, vehicle.nominal_track_m),
        plane=plane,
        clock=Clock("host", 0.0, 0.0, 0.0, 2),
        wheel_t_s=encoder.host_t_s,
        right_rad=right - right[0],
        left_rad=left - left[0],
        loose=np.zeros(right.size, dtype=bool),
        heading_t_s=ahrs.host_t_s[seen],
        yaw_rad=np.unwrap(np.radians(ahrs.yaw_deg[seen])),
        yaw_sigma_rad=None,
        pitch_rad=np.radians(ahrs.pitch_deg[seen]),
        roll_rad=np.radians(ahrs.roll_deg[seen]),
        fix_t_s=gnss.host_t_s[inside],
        fix_east_m=east[inside],
        fix_north_m=north[inside],
        fix_quality=np.full(count, 4),
        fix_var_east_m2=np.full(count, 1e-4),
        fix_var_north_m2=np.full(count, 1e-4),
        fix_cov_m2=np.zeros(count),
        fix_leading=np.ones(count, dtype=bool),
        notices=(),
    )


def innovations(log: Injected, effect: str, held: Mapping[str, float]) -> tuple[Floats, Floats]:
    """Heading (h,) and fix (f, 2) innovations of a filter that is told everything and learns nothing.

    Start, constants and offset are the truth without variance; the effect is held at the given values.
    """
    one = CATALOGUE[effect]
    columns = one.columns(log.view, held)
    names = [p.name for p in one.parameters]
    settings = log.simulated.settings
    vehicle = settings.vehicle
    constants = Constants(vehicle.radius_right_m, vehicle.radius_left_m, vehicle.track_m)
    raw = (log.timeline.right_rad, log.timeline.left_rad)
    run = Filter(log.aligned, log.timeline, NOISE, FilterOptions(gate_sigmas=30.0), constants, raw)
    placed = [Placed(names.index(column.parameter), column) for column in columns]
    first = log.simulated.motion.at(
        log.timeline.t_s[:1] - settings.clock.start_utc_s + settings.clock.host_epoch_offset_s
    )
    x = np.zeros(BASE_STATES)
    x[:3] = first.east_m[0], first.north_m[0], first.yaw_rad[0]
    x[3:6] = constants.as_array()
    x[6] = np.radians(settings.ahrs.heading_offset_deg)
    shapes = {p.name for p in one.parameters if p.shape}
    values = np.array([0.0 if name in shapes else held[name] for name in names])
    kernel.forward(
        run.events,
        kernel_columns(placed, log.timeline),
        run.model._replace(walk=np.zeros(BASE_STATES)),
        certain(x, values),
        run.memory,
        0,
        log.timeline.t_s.size,
        False,
        run.output,
    )
    return run.output.heading_nu, run.output.fix_nu


def certain(x: Floats, values: Floats) -> layout.Belief:
    """A belief that knows its core state (10,) and its parameters (m,) and learns nothing."""
    n, m = x.size, values.size
    return layout.Belief(x, values, np.zeros((n, n)), np.zeros((n, m)), np.zeros((m, m)))
