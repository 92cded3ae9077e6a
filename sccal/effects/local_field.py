"""Local field: iron in the ground, a gate or a parked truck turns the compass near one place.

heading += p exp(−d² / (2 radius²)), with d the robot's distance from the place
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, rounded, size
from sccal.simulate.physics import Physics
from sccal.simulate.world import State


class LocalField(Effect):
    """Deviation at the place, deg counter-clockwise; the place in the run's plane and its radius, m."""

    name = "local_field"
    title = "compass disturbed near one place"
    parameters = (
        Parameter("deg", "deg", 10.0, -90.0, 90.0, "run", matters=2),
        Parameter("east_m", "m", 100.0, -10000.0, 10000.0, "run", shape=True),
        Parameter("north_m", "m", 100.0, -10000.0, 10000.0, "run", shape=True),
        Parameter("radius_m", "m", 5.0, 0.2, 100.0, "run", shape=True),
    )
    looks_like = "the heading is wrong whenever the robot passes one place, and right elsewhere"
    excited_by = "pass the place several times, in different directions and at a second speed"
    reference = "Angermann et al. 2012, Characterization of the indoor magnetic field for applications in localization"
    shown_against = "east"
    search = "place"
    suspect_stream = "headings"

    def says(self, found: Mapping[str, Measured]) -> str:
        east, north = rounded(found["east_m"].value), rounded(found["north_m"].value)
        place = f"within about {size(found['radius_m'])} m of one place"
        where = f"({east} m east, {north} m north of the run's origin)"
        return f"{place} {where} the compass is turned by up to {size(found['deg'])} deg"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        seen = drive.headings
        distance2 = (seen.east_m - at["east_m"]) ** 2 + (seen.north_m - at["north_m"]) ** 2
        return (Column("deg", "heading", np.radians(np.exp(-0.5 * distance2 / at["radius_m"] ** 2))),)

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Buried(values["deg"], values["east_m"], values["north_m"], values["radius_m"])


@dataclass(frozen=True)
class _Buried(Physics):
    deg: float
    east_m: float
    north_m: float
    radius_m: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        place = {"east_m": self.east_m, "north_m": self.north_m, "radius_m": self.radius_m}
        return {"local_field": {"deg": self.deg, **place}}

    def heading(self, state: State, reading_rad: Floats) -> Floats:
        radii_away = np.hypot(state.east_m - self.east_m, state.north_m - self.north_m) / self.radius_m
        return np.asarray(reading_rad + np.radians(self.deg) * np.exp(-(radii_away**2) / 2.0))
