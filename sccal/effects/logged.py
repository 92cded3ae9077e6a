"""A further column of the log as a cause: what it scales, by the port at which it acts.

    heading~c   heading += p (c − c0)          along~c   travel of both wheels · (1 + p (c − c0))
    yaw~c       turning · (1 + p (c − c0))     side~c    travel to the left = p (c − c0) · travel
    pull~c      turning += p (c − c0) · travel

c0 is zero where the column reaches near zero, and its mean where it varies little about a large one (a temperature in
kelvin): the heading offset, the radii and the track then mean what they are at c0.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from sccal.align import Series
from sccal.effects.effect import Column, Effect, Parameter, Port
from sccal.effects.view import DriveView
from sccal.errors import UsageError
from sccal.results.model import Range
from sccal.simulate.physics import Physics

HEADING_PRIOR_DEG = 10.0
MOTION_PRIOR = 0.1
PULL_PRIOR = 0.02
"""Prior of what one standard deviation of a column does: degrees of heading, share of a motion, radians per metre."""
REACH = 10.0

_PORTS: dict[str, tuple[Port, str, str, str]] = {
    "heading": ("heading", "deg_per_unit", "deg", "turns the AHRS reading"),
    "along": ("along", "per_unit", "1", "stretches the distance driven"),
    "yaw": ("turn", "per_unit", "1", "stretches the turning"),
    "side": ("side", "per_unit", "1", "pushes the robot sideways as it drives"),
    "pull": ("turn", "per_m_per_unit", "rad/m", "pulls the robot to one side as it drives"),
}
"""By the name in the files: port, parameter, unit of the effect, what it does."""


class LoggedColumn(Effect):
    """One further column acting at one port."""

    looks_like = "the error follows a column of the log"
    excited_by = "let the column vary while everything else stays as it is"
    reference = "regression on a logged quantity"

    def __init__(self, where: str, column: str, values: Range) -> None:
        self.where, self.column, self.range = where, column, values
        self.port, parameter, unit, does = _PORTS[where]
        prior = {"heading": HEADING_PRIOR_DEG, "pull": PULL_PRIOR}.get(where, MOTION_PRIOR) / values.spread
        self.name = f"{where}~{column}"
        self.title = f"{column} {does}"
        self.parameters = (
            Parameter(parameter, f"{unit}/unit", prior, -REACH * prior, REACH * prior, matters=0.05 * prior),
        )

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        steps = drive.steps
        t_s = drive.headings.t_s if self.where == "heading" else steps.t_s - 0.5 * steps.dt_s
        column = drive.logged_at(self.column, t_s) - self.range.reference
        if self.column not in drive.logged:
            column = np.zeros(t_s.size)
        scaled = {
            "heading": np.radians(1.0),
            "along": steps.along_m,
            "yaw": steps.turn_rad,
            "side": steps.along_m,
            "pull": steps.along_m,
        }
        return (Column(self.parameters[0].name, self.port, scaled[self.where] * column),)

    def physics(self, values: Mapping[str, float]) -> Physics:
        """Raises UsageError: what stands in a logged column is not the simulator's to invent."""
        raise UsageError(f"effect {self.name}: a logged column cannot be simulated")


def logged_effects(runs: Iterable[Mapping[str, Series]]) -> tuple[LoggedColumn, ...]:
    """Every further column of the runs at every port."""
    by_name: dict[str, list[Series]] = {}
    for run in runs:
        for name, series in run.items():
            by_name.setdefault(name, []).append(series)
    ranges = {name: Range.of(one.values for one in series) for name, series in by_name.items()}
    return tuple(LoggedColumn(where, name, one) for name, one in ranges.items() if one.spread > 0 for where in _PORTS)
