"""What of a model is told and what stays: an effect that would have to be larger than any is another one."""

from __future__ import annotations

from dataclasses import replace

from sccal.diagnose.loop import sized_of
from sccal.effects.catalogue import CATALOGUE
from sccal.evidence.extension import Free
from sccal.evidence.model import Accepted, refitted
from tests.evidence.logs import bare


def arm_with_limits(metres: float):
    """An arm of 0.3 and −0.1 m in a log, and a catalogue in which none reaches further than so far."""
    effect = type(CATALOGUE["lever_arm"])()
    effect.parameters = tuple(replace(one, lower=-metres, upper=metres) for one in effect.parameters)
    model = bare("lever_arm=0.3,-0.1", duration_s=150.0)
    (sized,) = sized_of(refitted(model, [Accepted(Free(effect))]))
    return sized


def test_an_effect_within_its_limits_is_told():
    sized = arm_with_limits(3.0)
    assert sized.told
    assert sized.stays
    assert sized.beyond == ""


def test_an_effect_beyond_its_limits_is_not():
    sized = arm_with_limits(0.2)
    assert not sized.told
    assert not sized.stays
    assert "forward_m would be 0.3" in sized.beyond
    assert "m, not within -0.2 … 0.2" in sized.beyond
