"""What competes: every linear effect, every form that the drive can tell, and every column that says its own."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sccal.align import Series
from sccal.effects.catalogue import CATALOGUE
from sccal.effects.logged import logged_effects
from sccal.effects.view import DriveView
from sccal.evidence.candidates import gather_candidates, named_candidates, without_shadows
from sccal.evidence.extension import Free, plain_form, plain_forms
from tests.effects.harness import injected

WHERE = ("heading", "along", "yaw", "side", "pull")


@cache
def plain() -> DriveView:
    """A general drive without effects."""
    return injected("lever_arm", (0.0, 0.0)).view


def seen_with(**columns) -> DriveView:
    """The drive with further columns, each a function of the drive at the headings."""
    view = plain()
    t_s = view.headings.t_s
    return replace(view, logged={name: Series(t_s, np.asarray(of(view.headings))) for name, of in columns.items()})


def competing(view, *more):
    """Names of the columns that compete, and those that do not with what they follow."""
    views = [view, *more]
    columns = [Free(one) for one in logged_effects([one.logged for one in views])]
    kept, shadows = without_shadows(named_candidates(views), columns, views)
    assert {one.key for one in kept}.isdisjoint(shadows)
    assert {one.key for one in kept} | set(shadows) == {one.key for one in columns}
    return {one.key for one in kept}, shadows


def noise(size, share=1.0, seed=0):
    return share * np.random.default_rng(seed).normal(size=size)


def wandering(at, seed=5):
    """A current that wanders without regard to the drive."""
    rng = np.random.default_rng(seed)
    knots = np.arange(at.t_s[0], at.t_s[-1] + 4.0, 4.0)
    return np.interp(at.t_s, knots, rng.uniform(-4.0, 4.0, knots.size))


def every(name):
    return {f"{where}~{name}" for where in WHERE}


@pytest.mark.parametrize("sigma", [0.0, 0.02, 0.1])
@pytest.mark.parametrize("iron", [(0.0, 0.0), (0.3, -0.5)])
def test_a_raw_magnetometer_is_a_shadow_of_what_follows_the_heading(sigma, iron):
    """Field along the robot's axes: a turning vector, an iron's offset, and noise."""
    view = seen_with(
        mag_x=lambda at: 0.5 * (np.cos(at.yaw_rad) + iron[0]) + noise(at.t_s.size, 0.5 * sigma, 1),
        mag_y=lambda at: 0.5 * (-np.sin(at.yaw_rad) + iron[1]) + noise(at.t_s.size, 0.5 * sigma, 2),
    )
    kept, shadows = competing(view)
    assert kept == set()
    assert set(shadows) == every("mag_x") | every("mag_y")
    assert {"hard_iron", "soft_iron"} <= set(shadows["heading~mag_x"]) & set(shadows["heading~mag_y"])


def test_a_field_that_soft_iron_bends_is_one_too():
    kept, _ = competing(seen_with(mag_x=lambda at: np.cos(at.yaw_rad) + 0.2 * np.sin(2.0 * at.yaw_rad)))
    assert kept == set()


def test_a_copy_is_a_shadow_of_the_column_before_it():
    view = seen_with(
        current_a=wandering,
        copy=lambda at: 3.0 - 2.0 * wandering(at) + noise(at.t_s.size, 0.05),
        other=lambda at: wandering(at, 9),
    )
    kept, shadows = competing(view)
    assert kept == every("current_a") | every("other")
    assert shadows == {f"{where}~copy": (f"{where}~current_a",) for where in WHERE}


@pytest.mark.parametrize("of", [lambda v: v, abs, lambda v: 0.3 - 12.0 * v])
def test_a_copy_of_the_speed_is_a_shadow_of_what_follows_the_speed(of):
    kept, shadows = competing(seen_with(command=lambda at: of(at.speed_mps) + noise(at.t_s.size, 0.005)))
    assert kept == set()
    assert "speed_slip" in shadows["along~command"]
    assert "speed_field" in shadows["heading~command"]
    assert not any("lever_arm" in names for names in shadows.values())


def test_a_copy_of_the_turn_rate_is_one_of_what_follows_it():
    kept, shadows = competing(seen_with(gyro=lambda at: np.degrees(at.turn_rate_radps) + 0.1))
    assert kept == set()
    assert "turn_slip" in shadows["yaw~gyro"]


@pytest.mark.parametrize("share", [0.4, 1.0])
def test_a_motor_current_that_only_partly_follows_the_speed_competes(share):
    def current(at):
        return 2.0 + 3.0 * np.abs(at.speed_mps) + share * wandering(at)

    kept, shadows = competing(seen_with(motor_current_a=current))
    assert kept == every("motor_current_a")
    assert shadows == {}


def test_one_run_in_which_it_goes_its_own_way_is_enough():
    same = seen_with(command=lambda at: at.speed_mps)
    own = seen_with(command=wandering)
    assert competing(same)[0] == set()
    assert competing(same, own)[0] == every("command")
    assert competing(same, plain())[0] == set()


def test_every_linear_effect_competes_once_and_others_in_several_forms():
    found = gather_candidates([plain()])
    searched = {name for name, effect in CATALOGUE.items() if effect.search in ("moment", "place")}
    assert set(found.forms) <= set(CATALOGUE) - searched
    assert {name for name, effect in CATALOGUE.items() if effect.search == "none"} <= set(found.forms)
    for name, forms in found.forms.items():
        assert (len(forms) > 1) <= (CATALOGUE[name].search == "scale")
        assert len({one.key for one in forms}) == len(forms)
    assert {one.shapes["tau_s"] for one in found.forms["hard_iron"]} >= {0.0, 8.0}


def test_an_effect_is_plain_where_its_shapes_have_usual_values():
    names = {one.effect.name for one in plain_forms()}
    assert {"lever_arm", "hard_iron", "soft_iron"} <= names
    assert names.isdisjoint({"heading_step", "base_shift", "radius_step", "local_field"})
    assert plain_form(CATALOGUE["hard_iron"]).shapes == {"tau_s": 0.0}
    assert plain_form(CATALOGUE["heading_step"]) is None


def test_logged_columns_compete_beside_the_catalogue():
    found = gather_candidates([seen_with(current_a=wandering, mag_x=lambda at: np.cos(at.yaw_rad))])
    assert every("current_a") <= set(found.forms)
    assert set(found.shadows) == every("mag_x")
    assert "lever_arm" in found.forms
