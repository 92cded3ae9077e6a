"""One drive under one fault, filtered with and without the offset state, and judged by where the robot really was."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sccal.align import Aligned
from sccal.arrays import Bools, Floats
from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from sccal.degrade.faults import fault_run
from sccal.experiments.magnetometer import WanderingOffset
from sccal.experiments.plan import faults_of, judged_s
from sccal.filter.options import FilterOptions
from sccal.geodesy import TangentPlane
from sccal.logs.run import discover, read_run
from sccal.logs.streams import FixStream, Reference, Run
from sccal.results.calibration import Trajectory
from sccal.results.experiments import VARIANTS, Experiment, Filtered, Trial
from sccal.simulate.files import write_run, write_vehicle_file
from sccal.simulate.run import SimulatedRun, simulate_run
from sccal.simulate.settings import SimulationSettings

ERROR_RATE_HZ = 2.0
SAME_S = 1e-3


@dataclass(frozen=True)
class Truth:
    """Where the robot was: for a simulated run by the simulator, for a measured one by its own undisturbed fixes."""

    t_s: Floats
    """Times (n,) on the logging clock at which the errors are taken."""
    place_m: Callable[[TangentPlane], tuple[Floats, Floats]]
    """East and north (n,) in a plane."""
    parameters: tuple[float, float, float, float] | None = None
    """R_r, R_l, L (m) and heading offset (rad); None where nobody knows them."""


def simulated_trials(
    settings: SimulationSettings, experiments: tuple[Experiment, ...], options: CalibrationOptions
) -> list[Trial]:
    """One simulated drive under each fault in turn."""
    magnetometer = WanderingOffset(settings.seed)
    simulated = simulate_run(settings, [magnetometer])
    with tempfile.TemporaryDirectory() as folder:
        write_run(simulated, Path(folder) / settings.drive.path)
        write_vehicle_file(settings, Path(folder))
        (source,) = discover([Path(folder)])
        run = read_run(source)
    trials = []
    for experiment in experiments:
        truth = _simulated_truth(simulated, run)
        trial = try_run(run, experiment, truth, settings.seed, options)
        trials.append(replace(trial, offset_wander_rad=magnetometer.wander_rad(trial.t_s)))
    return trials


def try_run(run: Run, experiment: Experiment, truth: Truth, seed: int, options: CalibrationOptions) -> Trial:
    """One run under one fault. Raises DataError where the faulted run cannot be calibrated."""
    span_s = (float(run.wheels.t_s[0]), float(run.wheels.t_s[-1]))
    degraded, before = fault_run(run, faults_of(experiment, span_s, seed))
    degraded = replace(degraded, reference=Reference(before, _lost(before, degraded.fixes)))
    first, last = judged_s(experiment, span_s)
    judged = (truth.t_s > first) & (truth.t_s <= last)
    filtered, aligned = [], None
    for variant in VARIANTS:
        own = replace(options, filter=replace(options.filter, with_offset=variant == "with"))
        calibration, problem = calibrate_run(degraded, own)
        aligned = problem.aligned
        path = calibration.on_the_way
        assert path is not None
        east, north = truth.place_m(aligned.plane)
        error = np.hypot(
            np.interp(truth.t_s, path.t_s, path.east_m) - east, np.interp(truth.t_s, path.t_s, path.north_m) - north
        )
        filtered.append(
            Filtered(
                variant=variant,
                error_m=error,
                rms_m=float(np.sqrt(np.mean(error[judged] ** 2))),
                end_m=float(error[judged][-1]),
                parameters=calibration.parameters,
                path=_from_start(path, span_s[0]),
                history=replace(calibration.history, t_s=calibration.history.t_s - span_s[0]),
            )
        )
    assert aligned is not None
    east, north = truth.place_m(aligned.plane)
    return Trial(
        t_s=truth.t_s - span_s[0],
        true_east_m=east,
        true_north_m=north,
        judged=judged,
        fix_t_s=aligned.fix_t_s - span_s[0],
        fix_east_m=aligned.fix_east_m,
        fix_north_m=aligned.fix_north_m,
        filtered=tuple(filtered),
        true_parameters=truth.parameters,
    )


def measured_truth(aligned: Aligned, parameters: tuple[float, float, float, float]) -> Truth:
    """A run's own good fixes, and what its undisturbed calibration says, as the truth for a fault put into it."""
    rows = np.flatnonzero(aligned.fix_leading)
    plane = aligned.plane
    lat, lon = plane.to_lat_lon(aligned.fix_east_m[rows], aligned.fix_north_m[rows])
    return Truth(aligned.fix_t_s[rows], lambda other: other.to_east_north(lat, lon), parameters)


def default_options() -> CalibrationOptions:
    """Those of `sccal calibrate`."""
    return CalibrationOptions(filter=FilterOptions())


def _simulated_truth(simulated: SimulatedRun, run: Run) -> Truth:
    settings, motion = simulated.settings, simulated.motion
    begins_s = settings.clock.start_utc_s - settings.clock.host_epoch_offset_s
    first, last = float(run.wheels.t_s[0]), float(run.wheels.t_s[-1])
    t_s = np.arange(np.ceil(first * ERROR_RATE_HZ), np.floor(last * ERROR_RATE_HZ) + 1) / ERROR_RATE_HZ
    state = motion.at(t_s - begins_s)
    home = TangentPlane(settings.gnss.origin_lat_deg, settings.gnss.origin_lon_deg, settings.gnss.alt_m)
    lat, lon = home.to_lat_lon(state.east_m, state.north_m)
    vehicle = settings.vehicle
    return Truth(
        t_s,
        lambda plane: plane.to_east_north(lat, lon),
        (
            vehicle.radius_right_m,
            vehicle.radius_left_m,
            vehicle.track_m,
            float(np.radians(settings.ahrs.heading_offset_deg)),
        ),
    )


def _lost(before: FixStream, now: FixStream) -> Bools:
    """(n,) which of the earlier fixes are not in the log any more."""
    by_utc = bool(np.isfinite(before.utc_s).all())
    key, left = (before.utc_s, now.utc_s) if by_utc else (before.host_t_s, now.host_t_s)
    return ~np.isin(np.round(key / SAME_S), np.round(left / SAME_S))


def _from_start(path: Trajectory, begin_s: float) -> Trajectory:
    return replace(path, t_s=path.t_s - begin_s)
