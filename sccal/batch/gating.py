"""A batch as CI and people look at it: gates judged, then the index, JUnit XML and the page of a CI step written."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from sccal.batch.calibrating import Batch
from sccal.gates.asked import Asked
from sccal.logs.write import write_text
from sccal.report.fleet.junit import junit_xml
from sccal.report.fleet.step_summary import append_step_summary
from sccal.report.write import write_summary
from sccal.results.gates import BatchOutcome
from sccal.summary import summarise


def judged(batch: Batch, asked: Asked) -> BatchOutcome:
    """What the batch gave, and how the gates ended.

    Raises:
        UsageError: a gate asks for what no result has, or the baseline is of other vehicles.
    """
    runs, vehicles = tuple(batch.runs), {path.name: vehicle for vehicle, path in batch.vehicles}
    gates = asked.judge(runs, tuple(vehicles.values()))
    return BatchOutcome(runs, vehicles, tuple(batch.failures), gates)


def write_outcome(outcome: BatchOutcome, out: Path, junit: Path | None = None) -> Path | None:
    """The index in ``out`` (None where no run gave a result), JUnit XML, and the page of a GitHub step if there is one.

    Raises:
        UsageError: a file cannot be written.
    """
    if junit is not None:
        write_text(junit, junit_xml(outcome))
    append_step_summary(outcome, os.environ)
    if not outcome.runs:
        return None
    summary = summarise(outcome.runs, outcome.vehicles, outcome.failures, out)
    return write_summary(replace(summary, gates=outcome.gates), out)
