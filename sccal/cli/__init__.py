"""The command line: parse, call, print, exit code. Everything heavy is imported by the command that needs it."""

from sccal.cli import (
    calibrate,
    compare,
    convert,
    degrade,
    diagnose,
    effects,
    experiments,
    export,
    init,
    inspect,
    simulate,
)
from sccal.cli.app import app, main

__all__ = ["main"]

COMMANDS = (init, calibrate, diagnose, inspect, compare, export, simulate, degrade, convert, experiments, effects)
"""In the order in which the help lists them."""

app.registered_commands.sort(
    key=lambda command: [module.__name__ for module in COMMANDS].index(getattr(command.callback, "__module__", ""))
)
