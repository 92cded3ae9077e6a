"""Clock skew: the clock that stamps the fixes runs faster than the wheels' clock, by r parts per million.

Both agree at the run's start. What happens at a time t from there is stamped t (1 + r 10⁻⁶), so a fix stamped t shows
where the antenna was by a delay that grows, and r > 0 makes fixes older and older:

    delay = t r 10⁻⁶ / (1 + r 10⁻⁶) ≈ t r 10⁻⁶      fix as with a GNSS latency of that delay

The columns leave out the square of r 10⁻⁶. Which of the two clocks is right cannot be told.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.gnss_latency import TRANSPORT_S, late_fix
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, size
from sccal.simulate.physics import Physics, Sensor

_PER_PPM = 1e-6


class ClockSkew(Effect):
    """Rate of the fixes' clock against the wheels', ppm; above zero it runs fast."""

    name = "clock_skew"
    title = "the fixes' clock runs faster or slower than the wheels'"
    parameters = (Parameter("ppm", "ppm", 100.0, -5000.0, 5000.0, "run", matters=30),)
    stage = "body"
    looks_like = "fixes lag behind the path, or run ahead of it, in proportion to speed and more with every minute"
    excited_by = "drive for longer, keep moving, and stop or reverse 10 m now and then up to the end"
    reference = "Moon, Skelly and Towsley 1999, Estimation and removal of clock skew from network delay measurements"

    def says(self, found: Mapping[str, Measured]) -> str:
        way = "fast" if found["ppm"].value > 0.0 else "slow"
        return f"the fixes' clock runs {size(found['ppm'])} ppm {way} against the wheels'"

    def hidden_sigma(self, parameter: Parameter, duration_s: float) -> float:
        """A transport time that changes over a run passes for a skew of that change over the run's length."""
        return TRANSPORT_S / max(duration_s, 1.0) / _PER_PPM

    def fix_delay_s(self, drive: DriveView, at: Mapping[str, float]) -> Floats:
        return np.asarray(at["ppm"] * _PER_PPM * (drive.fixes.t_s - drive.start_s))

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        per_ppm_s = _PER_PPM * (drive.fixes.t_s - drive.start_s)
        forward, left = late_fix(drive, at["ppm"] * per_ppm_s)
        return (
            Column("ppm", "antenna_forward", per_ppm_s * forward),
            Column("ppm", "antenna_left", per_ppm_s * left),
        )

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Fast(values["ppm"])


@dataclass(frozen=True)
class _Fast(Physics):
    """The stamps are the receiver's; what they show is earlier. Receive times and UTC are wrong alike."""

    ppm: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"clock_skew": {"ppm": self.ppm}}

    def shown_time(self, sensor: Sensor, t_s: Floats) -> Floats:
        return t_s / (1.0 + self.ppm / 1e6) if sensor == "gnss" else t_s
