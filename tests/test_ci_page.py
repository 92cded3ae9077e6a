"""docs/ci.md: its workflows are YAML, and its commands are what the command line takes."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
import yaml

from sccal.cli import app
from sccal.errors import Exit
from sccal.gates.allowance import parse_allowance
from sccal.gates.expression import parse_gate

PAGE = (Path(__file__).parent.parent / "docs" / "ci.md").read_text(encoding="utf-8")
WORKFLOWS = [yaml.safe_load(block) for block in re.findall(r"```yaml\n(.*?)```", PAGE, re.S)]
COMMANDS = typer.main.get_command(app)


def lines_run(node: Any) -> Iterator[str]:
    """Every shell line of a workflow."""
    if isinstance(node, dict):
        for key, value in node.items():
            if key in ("run", "script"):
                for text in [value] if isinstance(value, str) else value:
                    yield from text.splitlines()
            else:
                yield from lines_run(value)
    elif isinstance(node, list):
        for value in node:
            yield from lines_run(value)


SHELL = [line for workflow in WORKFLOWS for line in lines_run(workflow) if line.startswith("sccal ")]
SHOWN = re.findall(r"^(?: {4})?(sccal .+?)(?:\s+#.*)?$", PAGE, re.M)
QUOTED = re.findall(r"`(--(?:gate|allow-drift) [^`]*)`", PAGE)


def options_of(line: str) -> list[tuple[str, str]]:
    words = shlex.split(line)
    return [(word, after) for word, after in zip(words, [*words[1:], ""], strict=True) if word.startswith("--")]


def test_there_is_something_to_check():
    assert len(WORKFLOWS) == 2
    assert len(SHELL) == 3
    assert len(SHOWN) == 6
    assert len(QUOTED) >= 4


@pytest.mark.parametrize("line", [*SHELL, *SHOWN])
def test_commands_are_understood(line):
    _, name, *arguments = shlex.split(line)
    command = COMMANDS.commands[name]
    assert command.make_context(name, arguments).params


@pytest.mark.parametrize("line", [*SHELL, *QUOTED])
def test_gates_and_allowances_can_be_read(line):
    for option, value in options_of(line):
        if option == "--gate":
            assert parse_gate(value)
        if option == "--allow-drift":
            assert parse_allowance(value)


def test_every_exit_code_is_told():
    told = [int(code) for code in re.findall(r"^\| (\d+) \|", PAGE, re.M)]
    assert told == [int(code) for code in Exit]
