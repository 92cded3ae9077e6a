"""All effects by name; an effect exists by standing in this list."""

from __future__ import annotations

from sccal.effects.antenna_height import AntennaHeight
from sccal.effects.base_shift import BaseShift
from sccal.effects.brake_slip import BrakeSlip
from sccal.effects.clock_skew import ClockSkew
from sccal.effects.drive_slip import DriveSlip
from sccal.effects.eccentric import EccentricLeft, EccentricRight
from sccal.effects.effect import Effect
from sccal.effects.fix_smoothing import FixSmoothing
from sccal.effects.gnss_latency import GnssLatency
from sccal.effects.hard_iron import HardIron
from sccal.effects.heading_drift import HeadingDrift
from sccal.effects.heading_latency import HeadingLatency
from sccal.effects.heading_scale import HeadingScale
from sccal.effects.heading_smoothing import HeadingSmoothing
from sccal.effects.heading_step import HeadingStep
from sccal.effects.lever_arm import LeverArm
from sccal.effects.local_field import LocalField
from sccal.effects.missed import MissedLeft, MissedRight
from sccal.effects.radius_drift import RadiusDrift, RadiusDriftLeft, RadiusDriftRight
from sccal.effects.radius_step import RadiusStep, RadiusStepLeft, RadiusStepRight
from sccal.effects.roll_slip import RollSlip
from sccal.effects.side_slip import SideSlip
from sccal.effects.slope import Slope
from sccal.effects.soft_iron import SoftIron
from sccal.effects.speed_field import SpeedField
from sccal.effects.speed_offset import SpeedOffset
from sccal.effects.speed_slip import SpeedSlip
from sccal.effects.track_step import TrackStep
from sccal.effects.turn_scrub import TurnScrub
from sccal.effects.turn_slip import TurnSlip
from sccal.errors import UsageError

CATALOGUE: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        LeverArm(),
        AntennaHeight(),
        TurnSlip(),
        TurnScrub(),
        SideSlip(),
        SpeedSlip(),
        SpeedOffset(),
        BrakeSlip(),
        DriveSlip(),
        Slope(),
        RollSlip(),
        RadiusDrift(),
        RadiusDriftLeft(),
        RadiusDriftRight(),
        RadiusStep(),
        RadiusStepLeft(),
        RadiusStepRight(),
        TrackStep(),
        EccentricLeft(),
        EccentricRight(),
        MissedLeft(),
        MissedRight(),
        GnssLatency(),
        FixSmoothing(),
        HeadingLatency(),
        HeadingSmoothing(),
        ClockSkew(),
        HardIron(),
        SoftIron(),
        HeadingDrift(),
        HeadingScale(),
        SpeedField(),
        HeadingStep(),
        BaseShift(),
        LocalField(),
    )
}


def effect_named(name: str) -> Effect:
    """The effect of that name. Raises UsageError with the names there are."""
    if name not in CATALOGUE:
        raise UsageError(f"no effect called {name!r}; there are {', '.join(sorted(CATALOGUE))}")
    return CATALOGUE[name]


def parse_effect(text: str) -> tuple[Effect, dict[str, float]]:
    """``lever_arm=0.3,-0.1``: the effect and its parameters' values in the order of ``sccal effects NAME``.

    Shapes at the end that have a value of their own may be left out. Raises UsageError for anything else.
    """
    name, equals, numbers = text.partition("=")
    effect = effect_named(name.strip())
    try:
        told = [float(number) for number in numbers.split(",")] if equals else []
    except ValueError:
        told = []
    names = [parameter.name for parameter in effect.parameters]
    least = _least(effect)
    if not least <= len(told) <= len(names):
        count = f"{least}" if least == len(names) else f"{least} to {len(names)}"
        raise UsageError(f"effect {text!r}: {effect.name} takes {count} numbers: {assignment(effect)}")
    unsaid = [parameter.left_out or 0.0 for parameter in effect.parameters[len(told) :]]
    return effect, dict(zip(names, [*told, *unsaid], strict=True))


def assignment(effect: Effect) -> str:
    """How it is put into a simulated log, what may be left out in brackets: ``hard_iron=cos_deg,sin_deg[,tau_s]``."""
    names, least = [parameter.name for parameter in effect.parameters], _least(effect)
    return f"{effect.name}={','.join(names[:least])}" + "".join(f"[,{name}]" for name in names[least:])


def _least(effect: Effect) -> int:
    """How many numbers it has to be told."""
    return max((k for k, one in enumerate(effect.parameters, 1) if one.left_out is None), default=0)
