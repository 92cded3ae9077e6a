"""``sccal diagnose``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sccal.cli.app import app
from sccal.cli.messages import columns, tell_failures
from sccal.cli.options import grouped
from sccal.cli.reading import Paths, Reading


@app.command()
@grouped
def diagnose(
    paths: Paths,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the results.")] = Path("out"),
    window: Annotated[float, typer.Option(help="Length of the outage windows, s.", min=1.0)] = 30.0,
    heading_rate: Annotated[float, typer.Option(help="Use at most so many AHRS readings per second.", min=0.1)] = 10.0,
    jobs: Annotated[
        int | None,
        typer.Option(help="Processes that share the runs; one on each core without it.", min=1, show_default=False),
    ] = None,
    *,
    read: Reading,
) -> None:
    """What the model lacks in the runs below PATHS: name it, add it, and judge before and after on data held out."""
    from sccal.logs.first_look import require_any_log

    require_any_log(paths)
    from sccal.cli.workers import one_thread_each, workers_among

    one_thread_each()
    workers = workers_among(paths, jobs)
    from sccal.batch.diagnosing import diagnose_paths
    from sccal.calibration.options import CalibrationOptions
    from sccal.report.diagnosis.text import diagnosis_text, next_line
    from sccal.results.files import MODEL_FILE

    options = CalibrationOptions(outage_window_s=window, heading_rate_hz=heading_rate)
    try:
        diagnosed, failures = diagnose_paths(paths, out, options, read.options(), workers)
    finally:
        if workers is not None:
            workers.close()
    width = columns()
    alone = len(diagnosed) == 1
    for diagnosis, page in diagnosed:
        print(diagnosis_text(diagnosis, width), end="")
        print()
        print(f"results in {page.parent}/, report: {page}")
        print(next_line(diagnosis, [str(path) for path in paths] if alone else [], str(page.with_name(MODEL_FILE))))
    tell_failures(failures, len(failures) + sum(len(diagnosis.runs) for diagnosis, _ in diagnosed))
