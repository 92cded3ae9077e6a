"""A figure of a run before it is drawn: into an SVG for the page, or onto a sheet of paper beside others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from sccal.report.drawing.panel import Sheet
from sccal.report.drawing.style import Drawing, styled, svg_text

WIDTH = 380.0
"""Points; as wide as a phone shows it, text at its size is still readable there."""


@dataclass(frozen=True)
class Plan:
    """What to draw, and how much room it needs."""

    name: str
    title: str
    caption: str
    height: float
    """Points."""
    draw: Callable[[Sheet], None]


def drawn(plan: Plan) -> Drawing:
    """As SVG, in the page's width."""
    with styled(plan.name):
        figure = Figure(figsize=(WIDTH / 72.0, plan.height / 72.0), dpi=72)
        plan.draw(Sheet(figure, 0.0, 0.0, WIDTH, plan.height))
        return Drawing(plan.name, plan.caption, svg_text(figure, rounded=True))
