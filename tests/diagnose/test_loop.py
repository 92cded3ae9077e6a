"""What of a model is told and what stays: an effect that would have to be larger than any is another one."""

from __future__ import annotations

from dataclasses import replace

from sccal.diagnose.loop import Loop, refine_again, sized_of
from sccal.effects.catalogue import CATALOGUE
from sccal.evidence.candidates import Candidates
from sccal.evidence.extension import Free
from sccal.evidence.model import Accepted, refitted
from sccal.evidence.saturated import saturate
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


def test_a_shape_that_is_refined_at_the_end_is_known_to_the_posterior():
    """Iron let in over 10 s, kept with 16: refined it is another key, which every later question goes by."""
    bare_model = bare("hard_iron=17,-11,10", duration_s=300.0)
    iron = Accepted(Free(CATALOGUE["hard_iron"], {"tau_s": 16.0}))
    arm = Accepted(Free(CATALOGUE["lever_arm"]))
    model = refitted(bare_model, [iron])
    loop = Loop(bare_model, model, Candidates((iron.free, arm.free)), saturate(model, [iron, arm], {}, None))
    loop.sized = sized_of(model)
    refine_again(loop)
    (kept,) = loop.kept
    assert kept != iron.key
    assert abs(loop.model.accepted[0].free.shapes["tau_s"] - 10.0) < 1.5
    assert set(loop.posterior.rows) == {kept, arm.key}
    assert [one.accepted.key for one in loop.sized] == [kept]
