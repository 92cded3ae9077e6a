"""Signs: a wrong setting is named, a right run passes, and a drive that cannot tell stays silent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sccal.align import align
from sccal.align.signs import slope_through_origin
from sccal.errors import DataError
from sccal.logs.streams import Run

DRIVES = {
    "general": {},
    "pivots to the left": {"path": "rectangle"},
    "pivots to the right": {"path": "rectangle", "rounds": "clockwise"},
    "left circle": {"path": "circle", "duration_s": 120.0},
    "right circle": {"path": "circle", "duration_s": 120.0, "rounds": "clockwise"},
    "both circles": {"path": "figure8", "duration_s": 150.0},
    "backwards first": {"path": "rectangle", "reverse_first_m": 20.0},
    "rows": {"path": "rows", "duration_s": 150.0},
    "straight": {"path": "straight"},
}
TURNING = tuple(name for name in DRIVES if name != "straight")
OTHER = {"enu": "ned", "ned": "enu"}


def other_convention(run: Run) -> Run:
    return replace(run, vehicle=replace(run.vehicle, convention=OTHER[run.vehicle.convention]))


def wheels_swapped(run: Run) -> Run:
    wheels = run.wheels
    return replace(run, wheels=replace(wheels, left_rad=wheels.right_rad, right_rad=wheels.left_rad))


def wheel_backwards(run: Run, side: str) -> Run:
    angle = getattr(run.wheels, f"{side}_rad")
    return replace(run, wheels=replace(run.wheels, **{f"{side}_rad": -angle}))


@pytest.fixture(scope="module")
def drive(simulate, streams):
    def of(name: str, convention: str = "enu", seed: int = 1, offset_deg: float = 137.0) -> Run:
        ahrs = {"convention": convention, "heading_offset_deg": offset_deg}
        return streams(simulate(seed=seed, ahrs=ahrs, **DRIVES[name]))

    return of


@pytest.mark.parametrize("convention", ["enu", "ned"])
@pytest.mark.parametrize("name", DRIVES)
def test_a_correct_run_passes(drive, name, convention):
    run = drive(name, convention)
    assert not [notice for notice in align(run).notices if notice.severity == "warning"]


@pytest.mark.parametrize("convention", ["enu", "ned"])
@pytest.mark.parametrize("name", [name for name in TURNING if name != "rows"])
def test_only_the_wrong_setting_is_named(drive, name, convention):
    right = drive(name, convention)
    with pytest.raises(DataError, match="sides with the wheels") as caught:
        align(other_convention(right))
    assert "swapped" not in str(caught.value)
    assert f'set convention = "{convention}" under [ahrs]' in str(caught.value)
    assert f'(it is "{OTHER[convention]}")' in str(caught.value)
    with pytest.raises(DataError, match="look swapped: exchange left_ticks and right_ticks") as caught:
        align(wheels_swapped(right))
    assert "set convention" not in str(caught.value)


@pytest.mark.parametrize("wrong", [other_convention, wheels_swapped])
@pytest.mark.parametrize("name", TURNING)
def test_turning_against_each_other_is_refused(drive, name, wrong):
    with pytest.raises(DataError, match="turns against the wheels"):
        align(wrong(drive(name)))


@pytest.mark.parametrize("name", ["pivots to the left", "pivots to the right", "rows"])
def test_right_angles_in_place_never_accuse_the_wrong_setting(drive, name):
    """A pivot by a right angle changes the course by ±90°, which modulo 180° has no sign: noise must not decide."""
    for seed in range(12):
        with pytest.raises(DataError, match="set convention"):
            align(other_convention(drive(name, seed=seed)))
        with pytest.raises(DataError, match="look swapped"):
            align(wheels_swapped(drive(name, seed=seed)))


@pytest.mark.parametrize("convention", ["enu", "ned"])
@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("name", TURNING)
def test_the_wheel_that_counts_backwards_is_named(drive, name, side, convention):
    with pytest.raises(DataError, match=rf"the {side} wheel seems to count backwards.*negate {side}_ticks$"):
        align(wheel_backwards(drive(name, convention), side))


@pytest.mark.parametrize("side", ["left", "right"])
def test_on_a_straight_line_one_wheel_counts_backwards(drive, side):
    with pytest.raises(DataError, match=r"one wheel seems to count backwards.*negate left_ticks or right_ticks$"):
        align(wheel_backwards(drive("straight"), side))


@pytest.mark.parametrize("wrong", [other_convention, wheels_swapped])
def test_a_straight_line_cannot_tell_and_says_nothing(drive, wrong):
    align(wrong(drive("straight")))


def test_the_message_holds_the_numbers(drive):
    with pytest.raises(DataError, match=r"slope -\d\.\d\d, correlation -0\.\d\d over \d+ s"):
        align(other_convention(drive("left circle")))


@given(st.floats(-100.0, 100.0).filter(lambda slope: abs(slope) > 1e-3), st.integers(8, 50))
def test_slope_of_a_line(slope, count):
    x = np.linspace(-1.0, 2.0, count)
    found = slope_through_origin(x, slope * x)
    assert found.value == pytest.approx(slope)
    assert found.correlation == pytest.approx(np.sign(slope))
    assert (found.clear, found.opposed) == (True, slope < 0)


def test_no_slope_where_nothing_varies_or_too_little_is_known():
    for x, y in ((np.zeros(20), np.ones(20)), (np.ones(20), np.zeros(20)), (np.zeros(0), np.zeros(0))):
        assert not slope_through_origin(x, y).clear
    for x in (np.ones(7), -np.ones(7)):
        few = slope_through_origin(np.ones(7), x)
        assert (few.clear, few.opposed) == (False, False)
    for tilt in (-0.1, 0.1):
        vague = slope_through_origin(np.ones(40), np.tile([1.0, -1.0], 20) + tilt)
        assert vague.value == pytest.approx(tilt)
        assert (vague.clear, vague.opposed) == (False, False)


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_counter_that_stands_still_is_named(drive, side):
    run = drive("general")
    still = np.zeros_like(run.wheels.t_s)
    with pytest.raises(DataError, match=rf"the {side} wheel's counter hardly moves.*column {side}_ticks$"):
        align(replace(run, wheels=replace(run.wheels, **{f"{side}_rad": still})))


def test_a_yaw_that_stands_still_while_the_wheels_turn_is_refused(drive):
    run = drive("left circle")
    stuck = np.full_like(run.heading.yaw_rad, 0.2)
    with pytest.raises(DataError, match=r"the yaw stays within 0\.00° while the wheels turn the robot by \d+°"):
        align(replace(run, heading=replace(run.heading, yaw_rad=stuck)))
