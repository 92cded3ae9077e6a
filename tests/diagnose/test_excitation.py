"""What a drive could have shown, what it could not, and what to drive instead."""

from __future__ import annotations

import pytest

from sccal.diagnose.excitation import excitation
from sccal.diagnose.loop import MIN_T, evidence_of, passes
from sccal.diagnose.pool import Pool
from sccal.effects.catalogue import CATALOGUE
from sccal.effects.lever_arm import LeverArm
from tests.diagnose.logs import bare, pooled

TURNS = ("turn_slip", "turn_scrub", "side_slip")


def test_a_straight_drive_shows_nothing_of_turns():
    hidden, shown, _ = excitation(pooled("straight"), [])
    advice = {one.name: one.advice for one in hidden}
    for name in (*TURNS, "hard_iron", "soft_iron"):
        assert advice[name] == CATALOGUE[name].excited_by
    assert not set(advice) & {one.name for one in shown}


def test_a_general_drive_shows_the_lever_arm_and_turns():
    hidden, shown, _ = excitation(pooled(), [])
    detectable = {one.name: one for one in shown}
    arm = detectable["lever_arm"]
    assert set(arm.smallest) == {"forward_m", "left_m"}
    assert max(arm.smallest.values()) <= 0.1
    assert arm.units == {"forward_m": "m", "left_m": "m"}
    assert arm.title == CATALOGUE["lever_arm"].title
    assert set(TURNS) < set(detectable)
    assert not set(TURNS) & {one.name for one in hidden}


def test_a_flat_drive_shows_nothing_of_slopes():
    hidden, _, _ = excitation(pooled(), [])
    assert {"slope", "roll_slip"} <= {one.name for one in hidden}


@pytest.mark.parametrize("path", ["general", "straight"])
def test_every_effect_is_hidden_or_shown(path):
    pool = pooled(path)
    hidden, shown, _ = excitation(pool, [])
    names = [one.name for one in hidden] + [one.name for one in shown]
    assert sorted(names) == sorted(effect.name for effect in pool.candidates)
    for one in shown:
        for parameter in CATALOGUE[one.name].parameters:
            assert parameter.matters <= one.smallest[parameter.name] <= parameter.prior_sigma


def test_what_is_found_needs_no_advice():
    hidden, shown, same = excitation(pooled(), [CATALOGUE["lever_arm"], CATALOGUE["slope"]])
    names = {one.name for one in hidden} | {one.name for one in shown} | {n for one in same for n in one.names}
    assert not names & {"lever_arm", "slope"}


@pytest.mark.parametrize("name", ["turn_slip", "heading_latency"])
def test_half_as_much_again_as_what_is_called_detectable_is_detected(name):
    _, shown, _ = excitation(pooled(), [])
    (size,) = next(one.smallest for one in shown if one.name == name).values()
    effects = pooled().candidates
    pool = Pool(evidence_of(bare(f"{name}={1.5 * size}"), effects), effects)
    score = pool.score(CATALOGUE[name])
    assert score.t > MIN_T
    assert passes(score)
    assert pool.ranked()[0].effect.name == name
    assert score.values[0] == pytest.approx(1.5 * size, rel=0.3)


def test_effects_that_are_one_on_this_drive_are_told_together():
    class Twin(LeverArm):
        name = "twin_arm"
        excited_by = "there is no such drive"

    effects = (CATALOGUE["lever_arm"], Twin(), CATALOGUE["soft_iron"])
    _, _, same = excitation(Pool(evidence_of(bare(), effects), effects), [])
    assert [one.names for one in same] == [("lever_arm", "twin_arm")]
    assert same[0].advice == f"{CATALOGUE['lever_arm'].excited_by}; {Twin.excited_by}"
    apart = (CATALOGUE["lever_arm"], CATALOGUE["soft_iron"])
    assert excitation(Pool(evidence_of(bare(), apart), apart), [])[2] == []
