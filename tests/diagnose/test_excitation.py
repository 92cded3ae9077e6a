"""What a drive could have shown, what it could not, and what to drive instead."""

from __future__ import annotations

import pytest

from sccal.diagnose.excitation import excitation
from sccal.effects.catalogue import CATALOGUE
from sccal.effects.lever_arm import LeverArm
from tests.diagnose.logs import everything_free, free_beside

TURNS = ("turn_slip", "turn_scrub", "side_slip")


def told(path="general", kept=()):
    full, candidates = everything_free(path)
    return excitation(full.posterior, candidates, kept, full.model)


def test_a_straight_drive_shows_nothing_of_turns():
    hidden, shown, _ = told("straight")
    advice = {one.name: one.advice for one in hidden}
    for name in (*TURNS, "hard_iron", "soft_iron"):
        assert advice[name] == CATALOGUE[name].excited_by
    assert not set(advice) & {one.name for one in shown}


def test_a_straight_drive_does_not_claim_to_show_the_lever_arm():
    hidden, _, _ = told("straight")
    assert "lever_arm" in {one.name for one in hidden}


def test_a_general_drive_shows_the_lever_arm_and_turns():
    hidden, shown, _ = told()
    detectable = {one.name: one for one in shown}
    arm = detectable["lever_arm"]
    assert set(arm.smallest) == {"forward_m", "left_m"}
    assert max(arm.smallest.values()) <= 0.1
    assert arm.units == {"forward_m": "m", "left_m": "m"}
    assert arm.title == CATALOGUE["lever_arm"].title
    assert set(TURNS) < set(detectable)
    assert not set(TURNS) & {one.name for one in hidden}


def test_a_flat_drive_shows_nothing_of_slopes():
    assert {"slope", "roll_slip"} <= {one.name for one in told()[0]}


@pytest.mark.parametrize("path", ["general", "straight"])
def test_every_linear_effect_is_hidden_or_shown(path):
    hidden, shown, _ = told(path)
    names = [one.name for one in hidden] + [one.name for one in shown]
    linear = {name for name, effect in CATALOGUE.items() if effect.search in ("none", "scale")}
    assert sorted(names) == sorted(linear)
    for one in shown:
        for parameter in CATALOGUE[one.name].parameters:
            if not parameter.shape:
                assert parameter.matters <= one.smallest[parameter.name] <= parameter.prior_sigma


def test_what_is_found_needs_no_advice():
    hidden, shown, same = told(kept=("lever_arm", "slope"))
    names = {one.name for one in hidden} | {one.name for one in shown} | {n for one in same for n in one.names}
    assert not names & {"lever_arm", "slope"}


def test_effects_that_are_one_on_this_drive_are_told_together():
    class Twin(LeverArm):
        name = "twin_arm"
        excited_by = "there is no such drive"

    def same(*effects):
        full, candidates = free_beside("general", effects)
        return excitation(full.posterior, candidates, (), full.model)[2]

    (twins,) = same(CATALOGUE["lever_arm"], Twin(), CATALOGUE["turn_slip"])
    assert twins.names == ("lever_arm", "twin_arm")
    assert twins.advice == f"{CATALOGUE['lever_arm'].excited_by}; {Twin.excited_by}"
    assert same(CATALOGUE["lever_arm"], CATALOGUE["turn_slip"]) == []
