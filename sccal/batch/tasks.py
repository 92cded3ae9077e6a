"""What is done with one run, as a pure function of its files and the options: here, in another process, or far away."""

from __future__ import annotations

import contextlib
import io
import platform
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import ThreadpoolController

import sccal
from sccal.align import align
from sccal.arrays import Floats
from sccal.batch.record import FileMark, RunRecord, key_of, record_from, record_text, without_arrays
from sccal.batch.remote import RemoteRun, fetched
from sccal.calibration.beside_small import judged_held_out, model_of_run, widened
from sccal.calibration.by_the_others import SaidByOthers, windows_by_others
from sccal.calibration.judged_model import check_vehicle, digest_of, notices_on_vehicle
from sccal.calibration.options import CalibrationOptions
from sccal.calibration.shared import SharedLikelihood, own_answer
from sccal.calibration.single import calibrate_run, prepare
from sccal.errors import SccalError, as_known
from sccal.filter.iterate import RunProblem
from sccal.logs.inputs import input_files
from sccal.logs.options import ReadOptions
from sccal.logs.run import RunSource, read_run
from sccal.logs.streams import Run
from sccal.report.write import write_calibration
from sccal.results.calibration import OutageWindow, Provenance
from sccal.results.model import JudgedModel
from sccal.results.noise import Noise

COMPUTING = ("numpy", "scipy", "numba")
"""Whose versions may change a result in its last digits."""

Source = RunSource | RemoteRun


@dataclass(frozen=True)
class Done:
    """What came of one run."""

    record: RunRecord | None = None
    """None where it failed, or where it stands already."""
    files: Mapping[str, bytes] | None = None
    """Every result file by name."""
    error: SccalError | None = None
    told: str = ""
    """For standard error: the traceback of a bug."""

    @property
    def unchanged(self) -> bool:
        """Whether the run's results stand already, from the same inputs, options and versions."""
        return self.record is None and self.error is None


@dataclass(frozen=True)
class AlsoWritten:
    """Files that a run's folder holds only where they are asked for."""

    mcap: bool = False
    """calibration.mcap: the results as messages."""
    pdf: bool = False
    """report.pdf."""


@dataclass(frozen=True)
class CalibrateRun:
    """One run to be calibrated."""

    source: Source
    options: CalibrationOptions
    read: ReadOptions
    also: AlsoWritten = AlsoWritten()
    standing_key: str = ""
    """Key of the whole results that stand already; the run is not repeated where its own is the same."""

    def __call__(self) -> Done:
        """Never raises but for what stops the process."""
        told = io.StringIO()
        try:
            with one_thread(), fetched(self.source) as source:
                return self._done(source)
        except Exception as error:
            with contextlib.redirect_stderr(told):
                known = as_known(error)
            return Done(error=known, told=told.getvalue())

    def _done(self, source: RunSource) -> Done:
        provenance = Provenance(input_files(source), options_by_name(self), versions())
        key = key_of(source.name, provenance)
        if key == self.standing_key:
            return Done()
        calibration, problem = calibrate_run(self._read(source), self.options)
        model = model_of_run(calibration, problem, self.options.heading_rate_hz)
        likelihood = None
        if not self.options.has_effects:
            likelihood = SharedLikelihood.of(problem, own_answer(calibration))
        calibration = replace(
            calibration,
            effects=widened(calibration.effects, model),
            held_out=judged_held_out(model, self.options.outage_window_s),
            notices=(*calibration.notices, *notices_on_vehicle(self.options.model, calibration.vehicle)),
            provenance=provenance,
        )
        with tempfile.TemporaryDirectory(prefix="sccal-") as scratch:
            write_calibration(calibration, Path(scratch), self.also.mcap, self.also.pdf)
            files = {path.name: path.read_bytes() for path in sorted(Path(scratch).iterdir())}
        marks = {name: FileMark.of(content) for name, content in files.items()}
        # As a later call would read it, so that nothing depends on which call it was.
        record = record_from(record_text(RunRecord(key, without_arrays(calibration), likelihood, marks)))
        return Done(record, files)

    def _read(self, source: RunSource) -> Run:
        run = read_run(source, self.read)
        check_vehicle(self.options.model, run.vehicle)
        return run


@dataclass(frozen=True)
class LineariseAgain:
    """What a calibrated run without effects says of the shared parameters, linearised at others than its own."""

    source: Source
    options: CalibrationOptions
    read: ReadOptions
    noise: Noise
    at: Floats
    """(3,) R_r, R_l and L, m."""

    def __call__(self) -> SharedLikelihood | SccalError:
        """The likelihood, or why there is none."""
        try:
            with one_thread(), fetched(self.source) as source:
                return SharedLikelihood.of(prepared_again(source, self.options, self.read, self.noise), self.at)
        except Exception as error:
            return as_known(error)


@dataclass(frozen=True)
class JudgeByOthers:
    """How far a calibrated run without effects drifts without fixes by what the other runs of its vehicle say."""

    source: Source
    options: CalibrationOptions
    read: ReadOptions
    noise: Noise
    said: SaidByOthers

    def __call__(self) -> tuple[OutageWindow, ...] | SccalError:
        """The windows, or why there is no answer."""
        try:
            with one_thread(), fetched(self.source) as source:
                problem = prepared_again(source, self.options, self.read, self.noise)
                options = self.options
                return windows_by_others(problem, self.said, options.heading_rate_hz, options.outage_window_s)
        except Exception as error:
            return as_known(error)


def prepared_again(source: RunSource, options: CalibrationOptions, read: ReadOptions, noise: Noise) -> RunProblem:
    """A run as calibrate_run left it, its noise known. Raises DataError where the run cannot be read any more."""
    aligned = align(read_run(source, read), options.withhold_s)
    return prepare(aligned, replace(options, noise=noise))


def options_by_name(task: CalibrateRun) -> dict[str, str]:
    """Every option that can change a result, by its name, as in force."""
    return {**_named(task.options), **_named(task.read, "read_"), **_named(task.also, "with_")}


@cache
def versions() -> dict[str, str]:
    """Of sccal, of Python and of the libraries that compute."""
    return {
        "sccal": sccal.__version__,
        "python": platform.python_version(),
        **{name: version(name) for name in COMPUTING},
    }


@contextmanager
def one_thread() -> Iterator[None]:
    """Linear algebra in one thread: how a sum is divided among several changes its last digits."""
    with _libraries().limit(limits=1):
        yield


@cache
def _libraries() -> ThreadpoolController:
    return ThreadpoolController()


def _named(options: Any, prefix: str = "") -> dict[str, str]:
    named: dict[str, str] = {}
    for field in fields(options):
        value = getattr(options, field.name)
        if isinstance(value, JudgedModel):
            named[field.name] = digest_of(value)
        elif is_dataclass(value) and field.name == "filter":
            named.update(_named(value))
        elif is_dataclass(value):
            named.update(_named(value, f"{prefix}{field.name}_"))
        else:
            named[prefix + field.name] = _word(value)
    return named


def _word(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if value is None:
        return "none"
    if isinstance(value, float | np.floating):
        return repr(float(value))
    if isinstance(value, tuple):
        between = ":" if any(isinstance(one, float) for one in value) else ","
        return between.join(_word(one) for one in value)
    return str(value)
