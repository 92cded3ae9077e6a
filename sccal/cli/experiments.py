"""``sccal experiments``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sccal.cli.app import app
from sccal.cli.messages import columns, tell_failures, tell_line


@app.command()
def experiments(
    paths: Annotated[
        list[Path] | None, typer.Argument(help="Runs of yours to put the same faults into.", show_default=False)
    ] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the results.")] = Path("out"),
    seeds: Annotated[int, typer.Option(help="Simulated drives of each kind.", min=1, max=1000)] = 20,
    duration: Annotated[float, typer.Option(help="Length of the simulated drives, s.", min=120.0)] = 600.0,
    jobs: Annotated[
        int | None, typer.Option(help="Processes; all cores without it.", min=1, show_default=False)
    ] = None,
) -> None:
    """The paper's experiments: fixes lost or noised, with and without the heading offset as a state."""
    from sccal.batch.experimenting import experiment_on_paths
    from sccal.report.experiments.text import experiments_text

    done, page, failures = experiment_on_paths(paths or [], out, seeds, duration, jobs, tell_line)
    print()
    print(experiments_text(done, columns()), end="")
    print()
    print(f"results in {out}/, report: {page}")
    tell_failures(failures, len(failures) + len({cell.path for cell in done.cells if cell.measured}))
