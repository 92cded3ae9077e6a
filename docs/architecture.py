"""Draw the building by the rooms in the package's docstring: ``docs/architecture.py > docs/architecture.svg``."""

from __future__ import annotations

import re
from xml.sax.saxutils import escape

import sccal

FLOOR_H, GAP, LEFT, WIDTH, TYPES = 40, 8, 46, 660, 250
INK, PAPER, WALL, ROOM, TYPE = "#1b1f24", "#ffffff", "#d0d7de", "#eef4fb", "#0b5cad"

MADE = {
    "logs": "Run: streams as logged",
    "align": "Aligned, Timeline: one clock",
    "effects": "Effect: parameters and columns",
    "filter": "Noise, RunProblem, ForwardPass",
    "evidence": "Model, JointFit, Posterior",
    "calibration": "Calibration, VehicleCalibration",
    "diagnose": "Diagnosis",
    "propose": "Proposal: a vehicle.toml",
    "results": "every result, written and read",
    "report": "text, pages, figures",
    "cli": "a table and an exit code",
}
"""What leaves a floor for the next one, by the room that makes it."""


def floors() -> list[list[str]]:
    """Names of rooms by floor, ground floor first."""
    listed = re.findall(r"^(\d+) +(\w+) +.*$", sccal.__doc__ or "", re.MULTILINE)
    found: dict[int, list[str]] = {}
    for floor, room in listed:
        found.setdefault(int(floor), []).append(room)
    return [found[number] for number in sorted(found)]


def picture() -> str:
    """The building as SVG: one row for each floor, the rooms in it, and what leaves it."""
    rows = floors()
    height = len(rows) * (FLOOR_H + GAP) + 46
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {LEFT + WIDTH + TYPES} {height}" '
        'font-family="system-ui, sans-serif" font-size="14" role="img" '
        'aria-label="The rooms of sccal by floor, and what each floor hands upward">',
        f'<rect width="100%" height="100%" fill="{PAPER}"/>',
        _text(LEFT, 22, "rooms: each may use those on floors below it", INK, 13),
        _text(LEFT + WIDTH + 16, 22, "what goes up", INK, 13),
    ]
    for number, rooms in enumerate(rows):
        y = 34 + (len(rows) - 1 - number) * (FLOOR_H + GAP)
        parts.append(_text(LEFT - 12, y + 26, str(number), INK, 13, "end"))
        wide = (WIDTH - GAP * (len(rooms) - 1)) / len(rooms)
        for k, room in enumerate(rooms):
            x = LEFT + k * (wide + GAP)
            box = f'x="{x:.1f}" y="{y}" width="{wide:.1f}" height="{FLOOR_H}" rx="5"'
            parts.append(f'<rect {box} fill="{ROOM}" stroke="{WALL}"/>')
            parts.append(_text(x + wide / 2, y + 26, room, INK, 15, "middle"))
        made = [MADE[room] for room in rooms if room in MADE]
        parts += [_text(LEFT + WIDTH + 16, y + 26, one, TYPE, 14) for one in made]
    return "\n".join([*parts, "</svg>"]) + "\n"


def _text(x: float, y: float, text: str, colour: str, size: int, anchor: str = "start") -> str:
    return f'<text x="{x:.1f}" y="{y}" fill="{colour}" font-size="{size}" text-anchor="{anchor}">{escape(text)}</text>'


if __name__ == "__main__":
    print(picture(), end="")
