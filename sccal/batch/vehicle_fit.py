"""The vehicle from its runs' records; a run is opened again only where its record does not say enough."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace

from sccal.batch.record import RunRecord
from sccal.batch.remote import fetched
from sccal.batch.tasks import CalibrateRun, JudgeByOthers, LineariseAgain, one_thread, prepared_again
from sccal.calibration.beside_small import judged_held_out, model_of_vehicle, widened
from sccal.calibration.by_the_others import SaidByOthers, held_out_of
from sccal.calibration.combine import combine, combined, only_run
from sccal.calibration.shared import MAX_ROUNDS, SharedFit, SharedLikelihood, far_off, pooled, stayed
from sccal.errors import SccalError
from sccal.processes import Workers
from sccal.results.calibration import HeldOut, OutageWindow, VehicleCalibration


@dataclass(frozen=True)
class Member:
    """One calibrated run of a vehicle."""

    task: CalibrateRun
    record: RunRecord


def vehicle_of_runs(members: Sequence[Member], workers: Workers) -> VehicleCalibration:
    """One result for all runs of a vehicle, one or more.

    Raises:
        SccalError: a run has to be opened again and cannot be.
    """
    runs = [member.record.calibration for member in members]
    if len(members) == 1:
        return only_run(runs[0])
    likelihoods = [member.record.likelihood for member in members if member.record.likelihood is not None]
    with one_thread():
        if len(likelihoods) < len(members):
            return _with_effects(members)
        vehicle = combined(runs, members[0].task.options.filter, _joint(members, likelihoods, workers))
        return replace(vehicle, held_out=_held_out(members, likelihoods, workers))


def _joint(members: Sequence[Member], likelihoods: list[SharedLikelihood], workers: Workers) -> SharedFit:
    """The joint answer; runs far off it are linearised again there, until it stays."""
    fit = pooled(likelihoods)
    for _ in range(MAX_ROUNDS - 1):
        far = far_off(likelihoods, fit)
        if not far:
            break
        tasks = [
            LineariseAgain(task.source, task.options, task.read, members[place].record.calibration.noise, fit.mode)
            for place in far
            for task in (members[place].task,)
        ]
        for number, found in workers.results(tasks):
            if isinstance(found, SccalError):
                raise type(found)(f"{members[far[number]].task.source.name}: {found}")
            likelihoods[far[number]] = found
        before, fit = fit, pooled(likelihoods)
        if stayed(before, fit):
            break
    return fit


def _held_out(members: Sequence[Member], likelihoods: Sequence[SharedLikelihood], workers: Workers) -> HeldOut | None:
    """Every run judged by the others, opened again by whoever does the work."""
    runs = [member.record.calibration for member in members]
    tasks = [
        JudgeByOthers(
            member.task.source,
            member.task.options,
            member.task.read,
            member.record.calibration.noise,
            SaidByOthers.of(likelihoods, runs, place),
        )
        for place, member in enumerate(members)
    ]
    windows: list[tuple[OutageWindow, ...]] = [()] * len(members)
    for place, found in workers.results(tasks):
        if isinstance(found, SccalError):
            raise type(found)(f"{members[place].task.source.name}: {found}")
        windows[place] = found
    return held_out_of(windows, members[0].task.options.outage_window_s)


def _with_effects(members: Sequence[Member]) -> VehicleCalibration:
    """All runs prepared again at once, by the noise that they were found to have."""
    with ExitStack() as stack:
        problems = []
        for one in members:
            source = stack.enter_context(fetched(one.task.source))
            noise = one.record.calibration.noise
            problems.append(prepared_again(source, one.task.options, one.task.read, noise))
        options = members[0].task.options
        vehicle = combine([member.record.calibration for member in members], problems)
        model = model_of_vehicle(vehicle, problems, options.heading_rate_hz)
        return replace(
            vehicle,
            effects=widened(vehicle.effects, model),
            held_out=judged_held_out(model, options.outage_window_s),
        )
