"""The application that commands register with, and how it ends: one line and an exit code, or a traceback and 4."""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

from sccal import __version__
from sccal.errors import Exit, SccalError

app = typer.Typer(
    name="sccal",
    help="Calibrate an outdoor robot's wheel radii, track width and heading offset from the logs it writes anyway.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def main() -> None:
    """Entry point: known failures are one line and an exit code, bugs a traceback and exit code 4."""
    try:
        app(standalone_mode=True)
    except SccalError as error:
        print(f"sccal: {error}", file=sys.stderr)
        sys.exit(int(error.exit_code))
    except BrokenPipeError:
        # The reader of a pipe went away (`| head`): not an error of ours, and nothing may be written any more.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(int(Exit.FINE))
    except Exception:
        import traceback

        traceback.print_exc()
        print("sccal: internal error; please report it with the lines above", file=sys.stderr)
        sys.exit(int(Exit.INTERNAL))


def _version(wanted: bool) -> None:
    if wanted:
        print(f"sccal {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    """Options before any command."""
