"""Runs in memory: a simulated drive, or wheels and a heading made by hand, as the readers would give them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from sccal.align import Aligned, Clock
from sccal.geodesy import TangentPlane
from sccal.logs.streams import FixStream, HeadingStream, Run, Vehicle, WheelStream
from sccal.simulate.run import SimulatedRun, simulate_run
from sccal.simulate.settings import (
    AhrsSettings,
    DriveSettings,
    EncoderSettings,
    GnssSettings,
    SimulationSettings,
)

VEHICLE = Vehicle("tracked-demo", Path("vehicle.toml"), 0.08, 0.70, ticks_per_rev=32768)


@cache
def simulated(settings: SimulationSettings) -> SimulatedRun:
    return simulate_run(settings)


@pytest.fixture(scope="session")
def simulate() -> Callable[..., SimulatedRun]:
    """A drive with small rates; ``ahrs`` and ``gnss`` replace single settings, the rest are the drive's."""

    def of(
        seed: int = 1,
        ahrs: dict[str, object] | None = None,
        gnss: dict[str, object] | None = None,
        **drive: object,
    ) -> SimulatedRun:
        return simulated(
            SimulationSettings(
                seed=seed,
                drive=replace(DriveSettings(path="general", duration_s=90.0), **drive),
                encoder=EncoderSettings(rate_hz=20.0),
                ahrs=replace(AhrsSettings(rate_hz=10.0), **(ahrs or {})),
                gnss=replace(GnssSettings(rate_hz=5.0), **(gnss or {})),
            )
        )

    return of


@pytest.fixture(scope="session")
def streams() -> Callable[..., Run]:
    """The streams of a simulated drive, without a detour through files."""

    def of(log: SimulatedRun, **vehicle: object) -> Run:
        rad_per_tick = 2.0 * np.pi / log.settings.encoder.ticks_per_rev
        count = log.gnss.utc_s.size
        return Run(
            name="run",
            path=Path("run"),
            vehicle=replace(VEHICLE, **{"convention": log.settings.ahrs.convention, **vehicle}),
            wheels=WheelStream(
                t_s=log.encoder.host_t_s,
                left_rad=log.encoder.left_ticks * rad_per_tick,
                right_rad=log.encoder.right_ticks * rad_per_tick,
                loose=np.zeros(log.encoder.host_t_s.size, dtype=bool),
            ),
            heading=HeadingStream(log.ahrs.host_t_s, np.radians(log.ahrs.yaw_deg)),
            fixes=FixStream(
                host_t_s=log.gnss.host_t_s,
                utc_s=log.gnss.utc_s,
                utc_has_date=True,
                lat_deg=log.gnss.lat_deg,
                lon_deg=log.gnss.lon_deg,
                alt_m=log.gnss.alt_m,
                quality=log.gnss.quality,
                sigma_east_m=np.full(count, np.nan),
                sigma_north_m=np.full(count, np.nan),
                cov_en_m2=np.zeros(count),
            ),
        )

    return of


@pytest.fixture(scope="session")
def aligned_by_hand() -> Callable[..., Aligned]:
    """An aligned run of given wheel samples and measurement times; headings are zeros, fixes a row of places."""

    def of(
        wheel_t_s: np.ndarray,
        right_rad: np.ndarray,
        left_rad: np.ndarray,
        heading_t_s: np.ndarray,
        fix_t_s: np.ndarray,
        loose: np.ndarray | None = None,
    ) -> Aligned:
        fixes = fix_t_s.size
        return Aligned(
            name="by hand",
            vehicle=VEHICLE,
            plane=TangentPlane(37.5, 15.0),
            clock=Clock("host", 0.0, 0.0, 0.0, 2),
            wheel_t_s=wheel_t_s,
            right_rad=right_rad,
            left_rad=left_rad,
            loose=np.zeros(wheel_t_s.size, dtype=bool) if loose is None else loose,
            heading_t_s=heading_t_s,
            yaw_rad=np.zeros(heading_t_s.size),
            yaw_sigma_rad=None,
            pitch_rad=None,
            roll_rad=None,
            fix_t_s=fix_t_s,
            fix_east_m=np.arange(fixes, dtype=float),
            fix_north_m=np.zeros(fixes),
            fix_quality=np.full(fixes, 4),
            fix_var_east_m2=np.full(fixes, 1e-4),
            fix_var_north_m2=np.full(fixes, 1e-4),
            fix_cov_m2=np.zeros(fixes),
            fix_leading=np.ones(fixes, dtype=bool),
            notices=(),
        )

    return of
