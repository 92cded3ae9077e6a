"""``sccal init``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sccal.cli.app import app
from sccal.errors import Exit
from sccal.logs.names import VEHICLE_FILE


@app.command("init")
def init(
    logs: Annotated[
        Path, typer.Argument(help="A run's folder, or a folder of runs of one vehicle.", show_default=False)
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help=f"The file to write, instead of {VEHICLE_FILE} in LOGS.", show_default=False),
    ] = None,
    radius_m: Annotated[
        float | None, typer.Option(help="Wheel radius (m) by the tape measure.", show_default=False)
    ] = None,
    ticks_per_turn: Annotated[
        float | None, typer.Option(help="Counts per turn of the wheel, after the gear.", show_default=False)
    ] = None,
    crs: Annotated[str, typer.Option(help="Grid of east and north: EPSG:32633, or local.", show_default=False)] = "",
    force: Annotated[bool, typer.Option("--force", help="Write over a file that is there.")] = False,
) -> None:
    """Propose a vehicle.toml for LOGS of any names and columns, say why, and write it."""
    from sccal.cli.messages import columns
    from sccal.propose.lines import proposal_text
    from sccal.propose.place import place_for, write_new
    from sccal.propose.propose import Told, propose

    place = place_for(logs, out, force)
    proposal = propose(logs, Told(radius_m, ticks_per_turn, crs).checked())
    write_new(place, proposal.text, force)
    print(proposal_text(proposal, place, logs, columns()), end="")
    if proposal.refusal:
        raise typer.Exit(int(Exit.DATA))
