"""Whether to believe a parameter, and if not, why and what to drive."""

from __future__ import annotations

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Effect, Parameter
from sccal.evidence.extension import FreeEffects
from sccal.filter.forward import prior_covariance
from sccal.filter.options import FilterOptions
from sccal.filter.start import Constants
from sccal.logs.names import VEHICLE_FILE
from sccal.logs.streams import Vehicle
from sccal.results.calibration import Drive, Estimate, Parameters, Status
from sccal.results.noise import Noise

UNOBSERVED_RATIO = 0.5
"""A parameter whose sigma is still more than this share of its prior's was not moved off the prior by the data."""
OFFSET_UNOBSERVED_RAD = np.radians(10.0)
FIX_WANDER_MOST = 5.0
"""Correlated fix error over the stated sigma: beyond, it is hardly the receiver that wanders."""
HEADING_WANDER_MOST_RAD = np.radians(3.0)
"""Correlated heading error: beyond, iron near the compass or a wrong clock is likelier than the AHRS itself."""


def fixes_wander(noise: Noise) -> bool:
    """Whether the fixes err slowly by far more than they state."""
    return bool(noise.fix_coloured_m > FIX_WANDER_MOST * noise.fix_stated_m)


def heading_wanders(noise: Noise) -> bool:
    """Whether the heading errs slowly by more than an AHRS does."""
    return bool(noise.heading_coloured_rad > HEADING_WANDER_MOST_RAD)


def judge(
    values: Floats,
    covariance: Floats,
    vehicle: Vehicle,
    options: FilterOptions,
    drive: Drive,
) -> Parameters:
    """Parameters from R_r, R_l, L, Ofs (4,) and their covariance (4, 4)."""
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    nominal = Constants.nominal(vehicle).as_array()
    prior = np.sqrt(np.diag(prior_covariance(Constants.nominal(vehicle), options)))
    factors = np.array([options.radius_bounds, options.radius_bounds, options.track_bounds])
    names = ("right radius", "left radius", "track")
    found: list[Estimate] = []
    for k in range(3):
        status, reason = "estimated", ""
        value = float(values[k])
        if sigma[k] > UNOBSERVED_RATIO * prior[k]:
            status = "unobserved"
            reason = _why_unobserved(names[k], drive)
        elif not factors[k, 0] * nominal[k] < value < factors[k, 1] * nominal[k]:
            status = "at_bound"
            reason = (
                f"the {names[k]} comes out at {value / nominal[k]:.2f} times its nominal value, beyond what wear or "
                f"load explain: check ticks_per_rev, wheel_radius_m and track_m in {VEHICLE_FILE}"
            )
        found.append(Estimate(value, float(sigma[k]), status, reason, float(nominal[k]), float(prior[k])))  # type: ignore[arg-type]
    return Parameters(found[0], found[1], found[2], _judge_offset(float(values[3]), float(sigma[3]), options))


def _judge_offset(value: float, sigma: float, options: FilterOptions) -> Estimate:
    wrapped = float(np.pi - (np.pi - value) % (2.0 * np.pi))
    if not options.with_offset:
        return Estimate(0.0, 0.0, "held", "held at zero: the filter without the offset state was asked for")
    if sigma > OFFSET_UNOBSERVED_RAD:
        reason = f"the heading offset is known to {np.degrees(sigma):.0f}° only: drive further in a straight line"
        return Estimate(wrapped, sigma, "unobserved", reason, None, options.offset_prior_rad)
    return Estimate(wrapped, sigma, "estimated", "", None, options.offset_prior_rad)


def _why_unobserved(name: str, drive: Drive) -> str:
    turned = np.degrees(drive.turned_left_rad + drive.turned_right_rad)
    did = f"this run drove {drive.distance_m:.0f} m and turned {turned:.0f}° in all"
    if name == "track":
        return f"the track cannot be seen in this run ({did}): spin in place both ways, or drive arcs to both sides"
    return f"the {name} cannot be told from the other constants in this run ({did}): drive straight and turn both ways"


def effect_estimates(extension: FreeEffects, values: Floats, covariance: Floats) -> dict[str, dict[str, Estimate]]:
    """What was found, by effect and parameter; values (m,) and covariance (m, m) in file units."""
    found: dict[str, dict[str, Estimate]] = {}
    sigmas = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    for (effect, one), value, sigma in zip(extension.parameters, values.tolist(), sigmas.tolist(), strict=True):
        found.setdefault(effect.name, {})[one.name] = _judge_effect(effect, one, value, sigma)
    for free in extension.effects:
        for name, shape in free.shapes.items():
            found.setdefault(free.effect.name, {})[name] = Estimate(float(shape), float("nan"), "held", "searched for")
    return found


def _judge_effect(effect: Effect, parameter: Parameter, value: float, sigma: float) -> Estimate:
    status: Status = "estimated"
    reason = ""
    if sigma > UNOBSERVED_RATIO * parameter.prior_sigma:
        status = "unobserved"
        reason = f"this drive does not show {effect.name} {parameter.name}: {effect.excited_by}"
    elif not parameter.lower < value < parameter.upper:
        status = "at_bound"
        reason = f"{effect.name} {parameter.name} beyond {parameter.lower:g} … {parameter.upper:g} {parameter.unit}"
    return Estimate(value, sigma, status, reason, None, parameter.prior_sigma)
