"""Shapes without a name: columns of the right length, finite, and about what they say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sccal.effects.catalogue import CATALOGUE
from sccal.effects.patterns import PATTERNS
from sccal.errors import UsageError
from tests.effects.harness import injected

BY_NAME = {pattern.name: pattern for pattern in PATTERNS}
HEADING = ("heading",)
AT_FIXES = ("antenna_forward", "antenna_left", "east", "north")

each_pattern = pytest.mark.parametrize("name", sorted(BY_NAME))


def view():
    """A drive over hills, with reverse legs, both turns and several speeds; the AHRS tells pitch and roll."""
    up, across = (injected(name, (size,)).view for name, size in (("slope", 1.0), ("roll_slip", 0.1)))
    return replace(up, steps=replace(up.steps, roll_rad=across.steps.roll_rad))


def columns(name):
    pattern = BY_NAME[name]
    return pattern.columns(view(), {one.name: 0.0 for one in pattern.parameters})


@each_pattern
def test_columns_have_the_rows_of_their_port(name):
    pattern, drive = BY_NAME[name], view()
    found = columns(name)
    assert list(dict.fromkeys(one.parameter for one in found)) == [one.name for one in pattern.parameters]
    assert found[0].port == pattern.port
    for one in found:
        rows = drive.headings if one.port in HEADING else drive.fixes if one.port in AT_FIXES else drive.steps
        assert one.values.shape == (rows.t_s.size,)
        assert one.values.dtype == np.float64
        assert np.all(np.isfinite(one.values))
        assert np.ptp(one.values) > 0.0


@each_pattern
def test_each_parameter_has_one_column_at_the_port(name):
    found = columns(name)
    assert len(found) == len(BY_NAME[name].parameters)
    assert {one.port for one in found} == {BY_NAME[name].port}


@pytest.mark.parametrize(
    ("name", "cause"),
    [
        ("heading with heading (third harmonic)", "heading"),
        ("heading with side of the last turn", "turn_rate"),
        ("antenna_left with turn rate", "turn_rate"),
        ("turn with speed squared (pull to one side)", "speed"),
        ("along with direction of travel", "speed"),
        ("antenna_forward with acceleration", "acceleration"),
        ("along with pitch", "pitch"),
        ("turn with roll", "roll"),
        ("turn with place", "east"),
        ("north with time", "time"),
    ],
)
def test_it_is_drawn_against_what_it_follows(name, cause):
    assert BY_NAME[name].shown_against == cause


@each_pattern
def test_columns_are_not_each_others_copies(name):
    stacked = np.stack([one.values / np.sqrt(np.mean(one.values**2)) for one in columns(name)])
    least = np.linalg.svd(stacked, compute_uv=False).min()
    assert least > 0.05 * np.sqrt(stacked.shape[1])


@each_pattern
def test_it_says_what_it_is(name):
    pattern = BY_NAME[name]
    assert pattern.port in pattern.title
    assert pattern.depends_on in pattern.title
    with pytest.raises(UsageError, match="cannot be simulated"):
        pattern.physics({one.name: 1.0 for one in pattern.parameters})
    for one in pattern.parameters:
        assert one.lower < -one.prior_sigma < 0.0 < one.matters < one.prior_sigma < one.upper


def test_names_are_unique_and_nobody_elses():
    assert len(BY_NAME) == len(PATTERNS)
    assert not set(BY_NAME) & set(CATALOGUE)


@pytest.mark.parametrize(("name", "order"), [("third", 3), ("fourth", 4)])
def test_harmonics_of_the_heading(name, order):
    cos, sin = columns(f"heading with heading ({name} harmonic)")
    assert cos.values + 1j * sin.values == pytest.approx(np.exp(1j * order * view().headings.yaw_rad))


@pytest.mark.parametrize("port", ["along", "turn"])
def test_the_direction_of_travel_is_there_in_reverse_only(port):
    (column,) = columns(f"{port} with direction of travel")
    reverse = view().steps.speed_mps < 0.0
    assert 10 < np.count_nonzero(reverse) < reverse.size
    assert np.all(column.values[~reverse] == 0.0)
    travel = view().steps.along_m if port == "along" else np.abs(view().steps.along_m)
    assert column.values[reverse] == pytest.approx(travel[reverse])


def test_the_side_of_the_last_turn_stays_until_the_next():
    (column,) = columns("heading with side of the last turn")
    rate = view().headings.turn_rate_radps
    turning = np.abs(rate) > 0.1
    assert np.array_equal(column.values[turning], np.sign(rate[turning]))
    changes = np.flatnonzero(np.diff(column.values)) + 1
    assert changes.size > 1
    assert np.all(turning[changes])


@pytest.mark.parametrize("name", [one.name for one in PATTERNS if one.depends_on == "time"])
def test_waves_of_time_turn_around_where_the_run_ends(name):
    """Half waves: even ones end where they began, odd ones opposite."""
    pattern, drive = BY_NAME[name], view()
    scale = {"along": drive.steps.along_m, "side": drive.steps.along_m, "turn": drive.steps.turn_rad}.get(pattern.port)
    for order, one in enumerate(columns(name), 1):
        if scale is None:
            assert one.values[0] == pytest.approx(1.0, abs=0.05)
            assert one.values[-1] == pytest.approx((-1.0) ** order, abs=0.05)
        else:
            assert np.all(np.abs(one.values) <= np.abs(scale) + 1e-12)


def test_pulls_to_one_side_have_the_sign_of_no_turn():
    """A pull turns the robot the same way in left and right turns; a share of the turn does not."""
    steps = view().steps
    (side,) = columns("turn with side of the turn")
    assert np.all(side.values[np.abs(steps.turn_rate_radps) > 0.05] >= 0.0)
    (speed,) = columns("turn with speed")
    clear = np.abs(steps.turn_rad * steps.speed_mps) > 1e-6
    assert np.array_equal(np.sign(speed.values[clear]), np.sign(steps.turn_rad[clear]))
