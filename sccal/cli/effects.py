"""``sccal effects``."""

from __future__ import annotations

from typing import Annotated

import typer

from sccal.cli.app import app
from sccal.cli.messages import columns


@app.command()
def effects(
    name: Annotated[str, typer.Argument(help="Explain this one.", show_default=False)] = "",
) -> None:
    """What the model may lack: list the effects of the catalogue, or explain one."""
    from sccal.effects.catalogue import CATALOGUE, effect_named
    from sccal.report.effects import effect_text, effects_text

    print(effect_text(effect_named(name), columns()) if name else effects_text(CATALOGUE.values(), columns()), end="")
