"""The building: imports point down only, the front door is light, and every room stays readable."""

from __future__ import annotations

import ast
import graphlib
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import sccal

PACKAGE = Path(sccal.__file__).parent
MODULES = sorted(PACKAGE.rglob("*.py"))
FLOORS = (
    {"errors", "arrays", "compiled"},
    {"geodesy", "randomness", "processes", "logs"},
    {"results"},
    {"align", "convert", "simulate", "degrade"},
    {"effects"},
    {"filter"},
    {"evidence"},
    {"calibration"},
    {"diagnose", "experiments", "inspect"},
    {"propose", "summary", "gates", "compare", "export"},
    {"report"},
    {"batch", "samples"},
    {"cli"},
)
"""Ground floor first; a room imports from lower floors only."""
BESIDE = ("docs", "studies", "benchmarks", "fuzz")
"""Code that uses the package and is no test of it."""
FREE = {"__init__", "__main__"}
MAY_IMPORT = {
    "simulate": {"errors", "arrays", "randomness", "geodesy", "logs"},
    "convert": {"errors", "arrays", "logs"},
    "degrade": {"errors", "arrays", "randomness", "geodesy", "logs"},
    "results": {"errors", "arrays", "logs"},
    "summary": {"errors", "arrays", "logs", "results"},
    "gates": {"errors", "arrays", "logs", "results"},
    "compare": {"errors", "arrays", "logs", "results"},
    "export": {"errors", "arrays", "geodesy", "logs", "results"},
}
"""Rooms that may use less than all the floors below: what makes or spoils logs shares nothing with what learns, and
what works on written results needs their files only."""
MUST_NOT_IMPORT = {"report": {"scipy", "numba"}, "cli": {"numpy", "pandas", "numba", "scipy", "matplotlib"}}
FILE_NAMES = re.compile(
    r"\b(encoder\.csv|ahrs\.csv|gnss\.(nmea|csv)|vehicle\.toml|metadata\.yaml)\b|(?<![\w*])\.(mcap|db3|bag)\b"
)
SPELL_FILE_NAMES = {"logs/names.py", "logs/formats.py"}
SAY_VEHICLE_TOML = {"batch/remote.py", "gates/baseline.py", "report/inspection/lines.py"}
"""Modules that spell no other name, and this one in what they say or look for."""
LONGEST_MODULE = 600
NAMES_OF_NOTHING = {"utils", "util", "helpers", "helper", "common", "misc"}

each_module = pytest.mark.parametrize("path", MODULES, ids=lambda path: path.relative_to(PACKAGE).as_posix())


def floor_of(room: str) -> int:
    for number, rooms in enumerate(FLOORS):
        if room in rooms:
            return number
    raise AssertionError(f"sccal.{room} is on no floor: give it one in FLOORS")


def room_of(path: Path) -> str:
    """The first name below the package: ``filter`` for filter/kernel.py, ``batch`` for batch.py."""
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


def imported(node: ast.AST, at_start_only: bool = False) -> Iterator[tuple[int, str]]:
    """Line and full name of every import, in functions too unless told, but none for type checkers only."""
    below: list[ast.AST] = list(ast.iter_child_nodes(node))
    if isinstance(node, ast.Import):
        yield from ((node.lineno, alias.name) for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        assert node.level == 0, f"line {node.lineno}: relative import"
        yield from ((node.lineno, f"{node.module}.{alias.name}") for alias in node.names)
    elif isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
        below = list(node.orelse)
    elif at_start_only and isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        below = []
    for child in below:
        yield from imported(child, at_start_only)


def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


def rooms_imported(path: Path) -> Iterator[tuple[int, str]]:
    for line, name in imported(parsed(path)):
        parts = name.split(".")
        if parts[0] == "sccal" and len(parts) > 1 and not parts[1].startswith("__"):
            yield line, parts[1]


def rooms() -> set[str]:
    """Every room, and every module beside the rooms, that the package has."""
    return {room_of(path) for path in MODULES} - FREE


def test_every_room_stands_on_one_floor():
    floors = [room for floor in FLOORS for room in floor]
    assert sorted(floors) == sorted(rooms())


def test_the_packages_docstring_lists_every_room_on_its_floor():
    listed = re.findall(r"^(\d+) +(\w+) +(.*)$", sccal.__doc__, re.MULTILINE)
    floors = [int(floor) for floor, _, _ in listed]
    assert floors == sorted(floors)
    assert {room for _, room, _ in listed} == rooms()
    assert sorted(zip(floors, (room for _, room, _ in listed), strict=True)) == sorted(
        (number, room) for number, floor in enumerate(FLOORS) for room in floor
    )
    assert [room for _, room, what in listed if not re.fullmatch(r"[A-Z].*\.", what)] == []


def test_imports_are_found_wherever_they_stand():
    source = """
import numpy
from typing import TYPE_CHECKING
if TYPE_CHECKING:
    from sccal.cli import main
else:
    import math
def late():
    try:
        from sccal.report import layout, write
    except ImportError:
        import sccal.batch
"""
    found = [name for _, name in imported(ast.parse(source))]
    assert found == [
        "numpy",
        "typing.TYPE_CHECKING",
        "math",
        "sccal.report.layout",
        "sccal.report.write",
        "sccal.batch",
    ]
    assert [name for _, name in imported(ast.parse(source), at_start_only=True)] == found[:3]


def test_the_package_is_seen():
    assert {"errors", "logs", "align", "filter", "cli"} <= {room_of(path) for path in MODULES}
    assert "calibration" in {room for _, room in rooms_imported(PACKAGE / "batch" / "tasks.py")}


@each_module
def test_imports_point_down_only(path):
    room = room_of(path)
    if room in FREE:
        return
    for line, other in rooms_imported(path):
        assert other == room or floor_of(other) < floor_of(room), f"line {line}: {room} imports {other}"


def module_of(path: Path) -> str:
    """The full name by which a module is imported."""
    return ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")


def test_no_module_needs_itself():
    modules = {module_of(path): path for path in MODULES}
    needs = {
        module: {name if name in modules else name.rpartition(".")[0] for _, name in imported(parsed(path))} - {module}
        for module, path in modules.items()
    }
    graphlib.TopologicalSorter(needs).prepare()  # raises CycleError with the circle


@each_module
def test_some_rooms_may_use_less(path):
    room = room_of(path)
    if room in MAY_IMPORT:
        for line, other in rooms_imported(path):
            assert other == room or other in MAY_IMPORT[room], f"line {line}: {room} imports {other}"


@each_module
def test_what_a_room_must_not_import(path):
    room = room_of(path)
    for line, name in imported(parsed(path), at_start_only=room == "cli"):
        assert name.split(".")[0] not in MUST_NOT_IMPORT.get(room, set()), f"line {line}: {room} imports {name}"


@each_module
def test_figures_are_drawn_without_pyplot(path):
    assert not [name for _, name in imported(parsed(path)) if name.startswith("matplotlib.pyplot")]


def texts(tree: ast.Module) -> Iterator[str]:
    """Every text in some code, but for docstrings."""
    said = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    yield from (
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in said
    )


@each_module
def test_names_of_a_logs_files_are_spelled_in_one_place(path):
    place = path.relative_to(PACKAGE).as_posix()
    spelled = {found[0] for text in texts(parsed(path)) for found in FILE_NAMES.finditer(text)}
    if place not in SPELL_FILE_NAMES:
        assert spelled <= ({"vehicle.toml"} if place in SAY_VEHICLE_TOML else set())


@pytest.mark.parametrize("start", ["import sccal", "import sccal.cli"])
def test_the_front_door_is_light(start):
    heavy = ("numpy", "pandas", "numba", "scipy", "matplotlib", "pyproj", "jinja2")
    script = f"import sys; {start}; print(*[name for name in {heavy!r} if name in sys.modules])"
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert found.stdout.split() == []


def test_help_needs_nothing_heavy():
    script = (
        "import sys\nsys.argv = ['sccal', 'calibrate', '--help']\nfrom sccal.cli import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "print([name for name in ('numpy', 'pandas', 'numba') if name in sys.modules])"
    )
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert found.stdout.splitlines()[-1] == "[]"


@each_module
def test_everything_public_says_what_it_is(path):
    tree = parsed(path)
    silent = [
        node.name
        for node in tree.body
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
        and not node.name.startswith("_")
        and not ast.get_docstring(node)
    ]
    if tree.body:
        assert ast.get_docstring(tree), "the module has no docstring"
    assert silent == []


@each_module
def test_modules_are_read_in_one_sitting(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) <= LONGEST_MODULE


def names_defined(tree: ast.Module) -> Iterator[tuple[str, ast.stmt]]:
    """What a module defines at its first level, but for what a decorator has handed to others."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            if not (node.decorator_list and isinstance(node, ast.FunctionDef)):
                yield node.name, node
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            yield from ((one.id, node) for target in targets for one in ast.walk(target) if isinstance(one, ast.Name))


def names_loaded(node: ast.AST) -> set[str]:
    """Names read in some code."""
    return {one.id for one in ast.walk(node) if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Load)}


@pytest.fixture(scope="module")
def names_used_elsewhere() -> set[str]:
    """Full names that anything but a test imports, for type checkers too, and all names that stand after a dot."""
    root = PACKAGE.parent
    trees = [parsed(path) for room in ("sccal", *BESIDE) for path in sorted((root / room).rglob("*.py"))]
    every = [node for tree in trees for node in ast.walk(tree)]
    return {node.attr for node in every if isinstance(node, ast.Attribute)} | {
        f"{node.module}.{alias.name}" for node in every if isinstance(node, ast.ImportFrom) for alias in node.names
    }


@each_module
def test_nothing_is_kept_that_nobody_uses(path, names_used_elsewhere):
    tree = parsed(path)
    module = module_of(path)
    loaded = [(node, names_loaded(node)) for node in tree.body]
    unused = [
        name
        for name, node in names_defined(tree)
        if not name.startswith("__")
        and not {name, f"{module}.{name}"} & names_used_elsewhere
        and not any(name in names for other, names in loaded if other is not node)
    ]
    assert unused == []


def test_modules_are_named_after_something():
    names = {part for path in MODULES for part in path.relative_to(PACKAGE).with_suffix("").parts}
    assert names & NAMES_OF_NOTHING == set()
