"""The states have names, and whoever reads or writes one uses its name."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import sccal

PACKAGE = Path(sccal.__file__).parent
ROOMS = ("filter", "evidence", "calibration", "diagnose")
OF_STATES = {"P", "V", "x", "slope", "variance", "walk", "final_state", "final_covariance"}


@pytest.mark.parametrize(
    "path",
    [path for room in ROOMS for path in sorted((PACKAGE / room).glob("*.py"))],
    ids=lambda path: path.relative_to(PACKAGE).as_posix(),
)
def test_no_state_is_told_by_its_number(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    by_number = [
        f"line {node.lineno}: {ast.unparse(node)}"
        for node in ast.walk(tree)
        if isinstance(node, ast.Subscript)
        and (node.value.attr if isinstance(node.value, ast.Attribute) else ast.unparse(node.value)) in OF_STATES
        and any(isinstance(one, ast.Constant) for one in _indices(node.slice))
    ]
    assert by_number == []


def _indices(index: ast.expr) -> list[ast.expr | None]:
    """What stands between commas and colons."""
    parts = index.elts if isinstance(index, ast.Tuple) else [index]
    return [end for one in parts for end in ((one.lower, one.upper) if isinstance(one, ast.Slice) else (one,))]
