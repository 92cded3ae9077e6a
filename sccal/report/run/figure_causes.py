"""Residuals against what may cause them: a mean that leaves zero follows the quantity below it."""

from __future__ import annotations

import math

import numpy as np

from sccal.arrays import Floats
from sccal.report.drawing.panel import Panel, Sheet, limits
from sccal.report.drawing.plan import Plan
from sccal.report.drawing.style import BLUE, INK, SOFT, VERMILION, strided
from sccal.results.calibration import Calibration, Cause
from sccal.results.numbers import plain

RESIDUALS = {"heading": ("heading", "deg"), "along": ("fix along", "m"), "across": ("fix to the left", "m")}
QUANTITIES = {
    "yaw": ("heading", "deg"),
    "turn_rate": ("turn rate to the left", "deg/s"),
    "speed": ("speed", "m/s"),
    "roll": ("roll, left side up", "deg"),
    "pitch": ("pitch, nose up", "deg"),
}
CLEAR_CHANCE = 1e-4
"""Below this the means do not lie off zero by chance."""
CLOUD = 250
_LEFT, _RIGHT, _BOTTOM, _ROW, _MIDDLE = 44.0, 8.0, 30.0, 125.0, 46.0


def causes_plan(c: Calibration) -> Plan:
    """Two panels a row."""
    return Plan(
        "causes",
        "Residuals against their causes",
        "Each dot is a measurement, each larger one the mean over a stretch of the quantity below it, with its "
        "standard error; means that stay on zero show no trend. Red means do not: the residual follows the quantity, "
        "and the model lacks something there.",
        _ROW * math.ceil(len(c.causes) / 2) + 6.0,
        lambda sheet: draw_causes(sheet, c.causes),
    )


def draw_causes(sheet: Sheet, causes: tuple[Cause, ...]) -> None:
    """From the upper left, in the order given."""
    width = 0.5 * (sheet.width - _LEFT - _RIGHT - _MIDDLE)
    for k, cause in enumerate(causes):
        left = _LEFT + (k % 2) * (width + _MIDDLE)
        bottom = sheet.height - 6.0 - _ROW * (k // 2 + 1) + _BOTTOM
        draw_cause(sheet, (left, bottom, width, _ROW - _BOTTOM - 20.0), cause)


def draw_cause(sheet: Sheet, box: tuple[float, float, float, float], cause: Cause) -> None:
    """Dots thinned, means with their errors on top."""
    (name, unit), (quantity, x_unit) = RESIDUALS[cause.residual], QUANTITIES[cause.quantity]
    y_turn, x_turn = (180.0 / math.pi if "deg" in u else 1.0 for u in (unit, x_unit))
    x, y = x_turn * cause.x, y_turn * cause.residuals
    means, sigmas = y_turn * cause.bin_mean, y_turn * cause.bin_sigma
    follows = clearly_follows(cause)
    reach = _reach(y, means, sigmas)
    panel = Panel(sheet, box, _span(x), (-reach, reach))
    panel.frame(f"{name} ({unit})", f"{quantity} ({x_unit})", (4, 4), note=_note(means, unit) if follows else "")
    some = strided(len(x), CLOUD)
    panel.dots(x[some], np.clip(y[some], -0.97 * reach, 0.97 * reach), SOFT, 1.3, 0.55)
    panel.level(0.0, INK, 0.8)
    colour = VERMILION if follows else BLUE
    panel.bars(x_turn * cause.bin_x, means, sigmas, colour, 1.4)
    panel.dots(x_turn * cause.bin_x, means, colour, 4.2)


def clearly_follows(cause: Cause) -> bool:
    """Whether the means lie off zero by more than chance allows."""
    return cause.chance < CLEAR_CHANCE


def _note(means: Floats, unit: str) -> str:
    return f"up to {plain(float(np.abs(means).max()), 2)} {unit}"


def _reach(y: Floats, means: Floats, sigmas: Floats) -> float:
    """Half the height: all means with their errors, and most of the dots."""
    usual = 1.2 * float(np.quantile(np.abs(y), 0.95)) if len(y) else 0.0
    return max(usual, 1.15 * float((np.abs(means) + sigmas).max(initial=0.0))) or 1.0


def _span(x: Floats) -> tuple[float, float]:
    return limits([np.quantile(x, (0.002, 0.998))], 0.03) if len(x) else (0.0, 1.0)
