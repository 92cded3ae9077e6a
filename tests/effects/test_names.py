"""An effect says everything about itself in its own file: nothing outside the catalogue knows one by its name."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import sccal
from sccal.effects.catalogue import CATALOGUE

PACKAGE = Path(sccal.__file__).parent
ROOMS_THAT_NAME_EFFECTS = {"effects", "export"}
"""The catalogue itself, and the formats of others: each has a field for some effects and none for the rest."""
OF_THE_SIMULATOR = {("simulate/files.py", "lever_arm")}
"""The simulator has an antenna of its own, whose place it writes into truth.json; it may not import the effects."""
MODULES = sorted(
    path for path in PACKAGE.rglob("*.py") if path.relative_to(PACKAGE).parts[0] not in ROOMS_THAT_NAME_EFFECTS
)


def names_in(source):
    """Line and name of every string that is an effect's name."""
    return [
        (node.lineno, node.value)
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value in CATALOGUE
    ]


def test_names_are_found_in_any_expression():
    assert names_in('"""On turn_slip."""\nKNOWN = {"turn_slip": f("a", name="slope")}\nx = "turn slip"\n') == [
        (2, "turn_slip"),
        (2, "slope"),
    ]


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_no_other_file_knows_an_effect_by_name(path):
    where = path.relative_to(PACKAGE).as_posix()
    found = names_in(path.read_text(encoding="utf-8"))
    assert [(line, name) for line, name in found if (where, name) not in OF_THE_SIMULATOR] == []
