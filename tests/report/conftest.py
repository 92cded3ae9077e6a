"""Synthetic results: a realistic run, and the ugly ones that a report must survive."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sccal.calibration.verdict import judged_run, judged_vehicle
from sccal.logs.streams import Notice, Vehicle
from sccal.results.calibration import (
    Calibration,
    Cause,
    Clock,
    Consistency,
    Drive,
    Estimate,
    Fit,
    Fixes,
    HeldOut,
    History,
    Manoeuvre,
    Noise,
    Origin,
    Outage,
    OutageWindow,
    Parameters,
    Residuals,
    Trajectory,
    VehicleCalibration,
)

VEHICLE = Vehicle("tracked-demo", Path("logs/vehicle.toml"), 0.08, 0.70, ticks_per_rev=32768)
START_S = 1717243201.0


def estimates() -> Parameters:
    return Parameters(
        Estimate(0.0808312, 0.0000119, "estimated", nominal=0.08, prior_sigma=0.0016),
        Estimate(0.0799021, 0.0000123, "estimated", nominal=0.08, prior_sigma=0.0016),
        Estimate(0.71234, 0.00087, "estimated", nominal=0.70, prior_sigma=0.05),
        Estimate(math.radians(-3.2145), math.radians(0.152), "estimated", prior_sigma=math.pi),
    )


def outage(windows: int = 8, window_s: float = 30.0) -> Outage:
    rng = np.random.default_rng(3)
    every = []
    for k in range(windows):
        t_s = START_S + 40.0 + 30.0 * k + np.arange(0.0, window_s, 0.2)
        drift_m = np.abs(np.cumsum(rng.normal(0.0005, 0.003, len(t_s)))) + 0.01
        every.append(
            OutageWindow(t_s[0], t_s[-1], 29.5, float(drift_m.mean()), float(drift_m[-1]), t_s, drift_m),
        )
    if not windows:
        return Outage(window_s, (), None, None, None, "no window")
    return Outage(window_s, tuple(every), 0.0612, 0.1187, 0.402, "the run before each window taught, the window judged")


def causes(rng: np.random.Generator) -> tuple[Cause, ...]:
    """One that stays on zero, and one that does not."""
    x = rng.uniform(-0.8, 0.8, 900)
    flat, bent = rng.normal(0.0, 0.003, (2, len(x)))
    bent = bent + 0.01 * x
    places = np.linspace(-0.75, 0.75, 16)
    errors = np.full(16, 0.0004)
    return (
        Cause("heading", "turn_rate", x, flat, places, rng.normal(0.0, 0.0004, 16), errors, 0.4),
        Cause("along", "speed", x, bent, places, 0.01 * places, errors, 1e-40),
        Cause("across", "roll", x, flat, np.empty(0), np.empty(0), np.empty(0), math.nan),
    )


def consistency(duration_s: float, rng: np.random.Generator) -> tuple[Consistency, ...]:
    t_s = START_S + duration_s * (np.arange(48) + 0.5) / 48.0
    ones = np.ones(48)
    nis = rng.normal(1.0, 0.2, 48)
    return (
        Consistency("fixes", t_s, nis, 0.6 * ones, 1.4 * ones, 0.951),
        Consistency("headings", t_s, 9.0 * nis, 0.6 * ones, 1.4 * ones, 0.31),
    )


MANOEUVRES = (
    Manoeuvre("straight", 101.5, 98.2, 0.3, (0.31, 1.52)),
    Manoeuvre("arc_left", 93.0, 84.0, 17.9, (0.52, 1.11)),
    Manoeuvre("spin_right", 12.0, 0.01, 9.1, (0.11, 0.25)),
    Manoeuvre("standing", 12.0, 0.0, 0.0, (0.0, 0.01)),
)


def run(
    name: str = "yard/figure-eight",
    duration_s: float = 300.0,
    heading_hz: float = 20.0,
    trajectory_hz: float = 10.0,
    seed: int = 1,
) -> Calibration:
    """A figure of eight around a drift, learnt from nominal values, with a third of the fixes floating."""
    rng = np.random.default_rng(seed)
    p = estimates()

    def pose(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        phase = 2.0 * np.pi * t / 100.0
        east, north = 22.0 * np.sin(phase) + 0.02 * t, 12.0 * np.sin(2.0 * phase)
        return east, north, np.arctan2(np.gradient(north, t), np.gradient(east, t))

    t = np.arange(0.0, duration_s, 1.0 / trajectory_hz)
    east, north, yaw = pose(t)
    small = np.full(len(t), 0.01)
    path = Trajectory(t + START_S, east, north, yaw, small, small, np.full(len(t), 0.004))

    fix_t = np.arange(0.0, duration_s, 0.2)
    fix_east, fix_north, _ = pose(fix_t)
    floating = (fix_t > 100.0) & (fix_t < 200.0)
    quality = np.where(floating, 5, 4)
    quality[:40] = 1
    fix_sigma = np.where(floating, 0.12, 0.015)
    fix_sigma[:40] = 0.8
    fix_noise = rng.normal(size=(2, len(fix_t))) * fix_sigma
    accepted = rng.random(len(fix_t)) > 0.01
    fix_noise[:, ~accepted] *= 40.0
    fixes = Fixes(fix_t + START_S, fix_east + fix_noise[0], fix_north + fix_noise[1], quality)

    heading_t = np.arange(0.0, duration_s, 1.0 / heading_hz)
    heading_sigma = np.full(len(heading_t), math.radians(0.9))
    heading_ok = rng.random(len(heading_t)) > 0.002
    heading = rng.normal(size=len(heading_t)) * heading_sigma * np.where(heading_ok, 1.0, 12.0)
    residuals = Residuals(
        heading_t + START_S, heading, heading_sigma, heading_ok,
        fix_t + START_S, fix_noise[0], fix_noise[1], 1.4 * fix_sigma, 1.4 * fix_sigma, accepted,
    )  # fmt: skip

    settled = np.exp(-t / 25.0)
    wander = np.cumsum(rng.normal(size=(4, len(t))), axis=1) / np.sqrt(len(t))

    def learnt(final: float, nominal: float, sigma: float, prior: float, k: int) -> tuple[np.ndarray, np.ndarray]:
        return final + (nominal - final) * settled + 2.0 * sigma * wander[k] * settled, sigma + prior * settled

    right, left = learnt(0.0808312, 0.08, 1.2e-5, 0.0016, 0), learnt(0.0799021, 0.08, 1.2e-5, 0.0016, 1)
    track = learnt(0.71234, 0.70, 8.7e-4, 0.05, 2)
    offset = learnt(math.radians(-3.2145), 0.3, math.radians(0.15), 0.5, 3)
    history = History(t + START_S, right[0], left[0], track[0], offset[0], right[1], left[1], track[1], offset[1])

    return judged_run(
        Calibration(
            run=name,
            vehicle=VEHICLE,
            with_offset=True,
            parameters=p,
            origin=Origin(37.525, 15.074),
            fit=Fit(0.0234, math.radians(0.91), 1.04, 0.97, 1488, 12, 5991, 9, 0),
            outage=outage(),
            noise=Noise(math.radians(0.42), math.radians(0.8), 17.3, 1.12, 0.011, 120.0, 0.0021),
            drive=Drive(duration_s, 412.3, 23.1, 12.0, 1.93, 18.9, 18.7),
            clock=Clock("utc_mapped", -1.2034, 23.4, 0.0042, 2),
            trajectory=path,
            history=history,
            residuals=residuals,
            fixes=fixes,
            causes=causes(rng),
            consistency=consistency(duration_s, rng),
            manoeuvres=MANOEUVRES,
            held_out=HeldOut(0.0301, 0.0552, "each of 4 stretches of the run judged by a fit that saw nothing of it"),
            notices=(
                Notice("encoder.csv", "rows with text cells dropped", 3, "line 40"),
                Notice("gnss.nmea", "sentences with a wrong checksum dropped", 12, "line 1023", "warning"),
            ),
        )
    )


def ugly_run(name: str = "campaign-2024-06-01/very/deep/folder/with-a-name-that-does-not-end/run-07") -> Calibration:
    """At a bound, unobserved, without sigma, without windows, locked out, and chatty."""
    good = run(name, duration_s=20.0)
    nan = float("nan")
    return judged_run(
        replace(
            good,
            parameters=Parameters(
                Estimate(0.096, 0.00001, "at_bound", "20 % above nominal: check ticks_per_rev", 0.08, 0.0016),
                Estimate(0.0799, nan, "estimated", "", 0.08, 0.0016),
                Estimate(
                    0.70,
                    0.05,
                    "unobserved",
                    "turned 2 deg in all: drive circles to both sides, at least one full turn each, "
                    "and calibrate again",
                    0.70,
                    0.05,
                ),
                Estimate(0.0, 0.0, "held", "", None, None),
            ),
            fit=Fit(nan, math.radians(0.3), 7.3, 0.97, 30, 70, 400, 0, 3),
            outage=outage(0),
            held_out=None,
            clock=Clock("host", 0.0, 0.0, nan, 2),
            notices=tuple(
                Notice(f"column_{k}.csv", "cells were empty", k + 1, f"line {k}", "warning" if k in (4, 8) else "info")
                for k in range(10)
            ),
        )
    )


def vehicle(*runs: Calibration) -> VehicleCalibration:
    notices = (Notice("run 3", "runs left out of the vehicle's fit, nothing observed", 1, "", "warning"),)
    return judged_vehicle(
        VehicleCalibration(
            VEHICLE,
            True,
            tuple(runs),
            estimates(),
            runs[0].fit,
            outage(16),
            1.21 if len(runs) > 1 else None,
            notices,
            held_out=HeldOut(0.0411, 0.0713, "each of 3 runs judged by constants fitted on the 2 others"),
        )
    )


@pytest.fixture(scope="session")
def a_run() -> Calibration:
    return run()


@pytest.fixture(scope="session")
def an_ugly_run() -> Calibration:
    return ugly_run()


@pytest.fixture(scope="session")
def a_vehicle() -> VehicleCalibration:
    return vehicle(run("yard/figure-eight"), run("yard/square", seed=2), ugly_run())


@pytest.fixture(scope="session")
def an_hour() -> Calibration:
    return run("field/hour", duration_s=3600.0, heading_hz=50.0)


@pytest.fixture(scope="session")
def run_of() -> Callable[..., Calibration]:
    return run
