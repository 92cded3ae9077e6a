"""All drives, faults and seeds, spread over processes and put together cell by cell."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
from scipy.special import stdtrit

from sccal.align import align
from sccal.arrays import Floats
from sccal.calibration.single import calibrate_run
from sccal.errors import SccalError
from sccal.experiments.plan import EXPERIMENTS, PATHS, robot
from sccal.experiments.trial import default_options, measured_truth, simulated_trials, try_run
from sccal.logs.run import RunSource, read_run
from sccal.results.calibration import Parameters
from sccal.results.experiments import (
    TOLERANCE_PERCENT,
    VARIANTS,
    Cell,
    Experiment,
    Experiments,
    Failed,
    Spread,
    Trial,
    Variant,
    VariantFigures,
)
from sccal.simulate.settings import PathName

MEASURED_SEEDS = 3
"""At most: a measured drive is the same each time, only the noise put into it differs."""
CLEAR_SIGMAS = 3.0
Outcome = Trial | Failed | None
"""None: the same as with the first seed, since nothing in it is random."""


def run_experiments(
    seeds: int,
    duration_s: float,
    runs: Sequence[RunSource] = (),
    jobs: int | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> Experiments:
    """The paper's experiments on simulated drives, and the same faults in the given runs.

    ``tell`` is called with a line whenever a drive is done. A run that fails is told in the result and stops nothing.
    """
    numbers = tuple(range(1, seeds + 1))
    drives = [(path, seed) for seed in numbers for path in PATHS]
    given = [(run, seed) for run in runs for seed in numbers[:MEASURED_SEEDS]]
    workers = min(jobs or os.cpu_count() or 1, max(len(drives) + len(given), 1))
    trials: dict[tuple[str, str], list[tuple[int, Trial]]] = {}
    failed: list[Failed] = []
    tasks: list[tuple[str, int, Callable[[], list[Outcome]]]] = [
        *((path, seed, partial(_simulated, path, seed, duration_s)) for path, seed in drives),
        *((run.name, seed, partial(_measured, run, seed)) for run, seed in given),
    ]
    for (name, seed, _), found in zip(tasks, _each([task for _, _, task in tasks], workers), strict=True):
        for experiment, one in zip(EXPERIMENTS, found, strict=True):
            if isinstance(one, Failed):
                failed.append(one)
            elif one is not None:
                trials.setdefault((name, experiment.key), []).append((seed, one))
        tell(f"{name}, seed {seed}")
    names = [*PATHS, *dict.fromkeys(run.name for run in runs)]
    cells = [
        _cell(experiment, name, k >= len(PATHS), trials[name, experiment.key])
        for experiment in EXPERIMENTS
        for k, name in enumerate(names)
        if (name, experiment.key) in trials
    ]
    return Experiments(tuple(cells), duration_s, numbers, tuple(dict.fromkeys(failed)))


def _each(tasks: list[Callable[[], list[Outcome]]], workers: int) -> Iterable[list[Outcome]]:
    if workers < 2:
        for task in tasks:
            yield task()
        return
    # Started afresh: forking beside threads that the kernels use is not safe.
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        for future in [pool.submit(task) for task in tasks]:
            yield future.result()


def _simulated(path: PathName, seed: int, duration_s: float) -> list[Outcome]:
    try:
        return [*simulated_trials(robot(path, seed, duration_s), EXPERIMENTS, default_options())]
    except SccalError as error:
        return [Failed(f"{path}, seed {seed}", str(error)) for _ in EXPERIMENTS]


def _measured(source: RunSource, seed: int) -> list[Outcome]:
    """The run under each fault; its truth is what it says undisturbed."""
    options = default_options()
    try:
        run = read_run(source)
        undisturbed, _ = calibrate_run(run, options)
        truth = measured_truth(align(run), _values(undisturbed.parameters))
    except SccalError as error:
        return [Failed(source.name, str(error)) for _ in EXPERIMENTS]
    found: list[Outcome] = []
    for experiment in EXPERIMENTS:
        if experiment.is_loss and seed > 1:
            found.append(None)
            continue
        try:
            found.append(try_run(run, experiment, truth, seed, options))
        except SccalError as error:
            found.append(Failed(f"{source.name}, {experiment.title}", str(error)))
    return found


def _values(found: Parameters) -> tuple[float, float, float, float]:
    return (
        found.radius_right_m.value,
        found.radius_left_m.value,
        found.track_m.value,
        found.heading_offset_rad.value,
    )


def _cell(experiment: Experiment, name: str, measured: bool, trials: list[tuple[int, Trial]]) -> Cell:
    shown = trials[0][1]
    figures = {variant: _figures(variant, [trial for _, trial in trials]) for variant in VARIANTS}
    truth = shown.true_parameters
    errors, within, why = np.zeros((0, 3)), 0, ""
    if truth is not None:
        true = np.array(truth[:3])
        errors = 100.0 * (figures["with"].values[:, :3] / true - 1.0)
        good = (np.abs(errors) <= TOLERANCE_PERCENT).all(axis=1)
        within = int(good.sum())
        why = _why_not(errors, 100.0 * figures["with"].sigmas[:, :3] / true)
    return Cell(
        experiment=experiment,
        path=name,
        measured=measured,
        seeds=tuple(seed for seed, _ in trials),
        t_s=shown.t_s[: figures["with"].error_over_time_m[0].size],
        judged=shown.judged[: figures["with"].error_over_time_m[0].size],
        figures=figures,
        ratio=_ratio(figures["without"].rms_m, figures["with"].rms_m),
        truth=None if truth is None else (*truth[:3], float(np.degrees(truth[3]))),
        errors_percent=errors,
        within_percent=within,
        why_not=why,
        shown=shown,
    )


def _figures(variant: Variant, trials: list[Trial]) -> VariantFigures:
    own = [trial.of(variant) for trial in trials]
    count = min(one.error_m.size for one in own)
    errors = np.array([one.error_m[:count] for one in own])
    found = [one.parameters for one in own]
    values = np.array([_values(p) for p in found])
    sigmas = np.array(
        [[p.radius_right_m.sigma, p.radius_left_m.sigma, p.track_m.sigma, p.heading_offset_rad.sigma] for p in found]
    )
    values[:, 3], sigmas[:, 3] = np.degrees(values[:, 3]), np.degrees(sigmas[:, 3])
    rms = np.array([one.rms_m for one in own])
    end = np.array([one.end_m for one in own])
    low, median, high = np.quantile(errors, (0.05, 0.5, 0.95), axis=0)
    return VariantFigures(
        rms_m=rms,
        end_m=end,
        values=values,
        sigmas=sigmas,
        statuses=tuple(
            (p.radius_right_m.status, p.radius_left_m.status, p.track_m.status, p.heading_offset_rad.status)
            for p in found
        ),
        error_over_time_m=(median, low, high),
        rms_spread_m=_spread(rms),
        end_spread_m=_spread(end),
    )


def _spread(values: Floats) -> Spread:
    low, median, high = (float(v) for v in np.quantile(values, (0.05, 0.5, 0.95)))
    return Spread(median, low, high)


def _ratio(without: Floats, with_offset: Floats) -> Spread:
    logs = np.log(without / with_offset)
    mean = float(logs.mean())
    if logs.size < 2:
        return Spread(float(np.exp(mean)), float("nan"), float("nan"))
    half = float(stdtrit(logs.size - 1, 0.975) * logs.std(ddof=1) / np.sqrt(logs.size))
    return Spread(float(np.exp(mean)), float(np.exp(mean - half)), float(np.exp(mean + half)))


def _why_not(errors_percent: Floats, sigmas_percent: Floats) -> str:
    """Whether parameters beyond the tolerance are what their sigmas allow."""
    beyond = np.abs(errors_percent) > TOLERANCE_PERCENT
    if not beyond.any():
        return ""
    names = ("right radius", "left radius", "track")
    worst = [name for name, column in zip(names, beyond.T, strict=True) if column.any()]
    apart = np.abs(errors_percent[beyond]) / sigmas_percent[beyond]
    claimed = float(np.median(sigmas_percent[:, beyond.any(axis=0)]))
    allowed = (
        f"each within {CLEAR_SIGMAS:g} of its own sigmas"
        if (apart <= CLEAR_SIGMAS).all()
        else f"up to {apart.max():.1f} of their own sigmas off"
    )
    return f"{', '.join(worst)}: this drive and these fixes give ± {claimed:.2g} %; {allowed}"
