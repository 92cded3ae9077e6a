"""One simulated run: the three stages put together, in memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sccal.simulate.paths import plan_drive
from sccal.simulate.physics import Physics
from sccal.simulate.sensors import AhrsLog, EncoderLog, GnssLog, read_ahrs, read_encoders, read_gnss
from sccal.simulate.settings import SimulationSettings
from sccal.simulate.world import Motion, WheelPair, integrate, rim_travel, wheel_angles


@dataclass(frozen=True)
class SimulatedRun:
    """The streams of a run, and the truth behind them."""

    settings: SimulationSettings
    motion: Motion
    wheel_angle_rad: WheelPair
    """Cumulative, at the times of ``motion``, slip included."""
    encoder: EncoderLog
    ahrs: AhrsLog
    gnss: GnssLog
    physics: tuple[Physics, ...] = ()
    """The further effects that acted."""


def simulate_run(settings: SimulationSettings, physics: Sequence[Physics] = ()) -> SimulatedRun:
    """Drive the path and log it; each effect in ``physics`` acts at its own stages, in the order given."""
    seed, clock = settings.seed, settings.clock

    steps = plan_drive(settings.drive, seed).steps(settings.drive.grid_hz)
    for effect in physics:
        steps = effect.body(steps)
    motion = integrate(steps)

    travel_m = rim_travel(steps, settings.vehicle.track_m)
    for effect in physics:
        travel_m = effect.wheel_travel(motion, travel_m)
    angle_rad = wheel_angles(travel_m, settings.vehicle, seed)
    for effect in physics:
        angle_rad = effect.wheel_angle(motion, angle_rad)

    return SimulatedRun(
        settings=settings,
        motion=motion,
        wheel_angle_rad=angle_rad,
        encoder=read_encoders(motion, angle_rad, settings.encoder, clock, seed, physics),
        ahrs=read_ahrs(motion, settings.ahrs, clock, seed, physics),
        gnss=read_gnss(motion, settings.gnss, clock, seed, physics),
        physics=tuple(physics),
    )
