"""Every run of one call inspected."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sccal.batch.vehicles import check_out
from sccal.errors import Failure, as_known
from sccal.filter.forward import say_if_compiling
from sccal.inspect.inspect import inspect_run
from sccal.logs.options import ReadOptions
from sccal.logs.run import find_runs
from sccal.report.write import begin_loading, write_inspection
from sccal.results.inspection import Inspection


def inspect_paths(
    paths: Sequence[Path], out: Path | None, read: ReadOptions | None = None
) -> tuple[list[tuple[Inspection, Path | None]], list[Failure]]:
    """Inspect every run below the paths; with ``out``, a page and JSON for each to out/<run>.

    Returns every inspection with its page, and what could not be inspected at all.
    """
    sources, failures = find_runs(paths)
    if sources:
        if out is not None:
            check_out(out, sources)
            begin_loading()
        say_if_compiling()
    inspected: list[tuple[Inspection, Path | None]] = []
    for source in sources:
        try:
            found = inspect_run(source, read)
            page = None if out is None else write_inspection(found, out / source.name)
        except Exception as error:
            failures.append(Failure(source.name, as_known(error)))
            continue
        inspected.append((found, page))
    return inspected, failures
