"""Every effect of the catalogue: its columns against its physics, and its description.

With the truth held fixed, a noiseless log leaves no innovation. If a column had a wrong sign, the innovation would
double; if it stood at the wrong port, it would stay.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sccal.effects.catalogue import CATALOGUE, parse_effect
from sccal.errors import UsageError
from tests.effects.harness import injected, innovations

SIZES: dict[str, tuple[float, ...]] = {
    "lever_arm": (0.3, -0.1),
    "antenna_height": (2.0,),
    "turn_slip": (0.2,),
    "turn_scrub": (0.1,),
    "side_slip": (0.1,),
    "speed_slip": (0.03,),
    "speed_offset": (0.05, 0.03),
    "brake_slip": (0.05,),
    "drive_slip": (0.05,),
    "slope": (1.0,),
    "roll_slip": (0.1,),
    "radius_drift": (0.1,),
    "radius_drift_left": (0.1,),
    "radius_drift_right": (-0.1,),
    "radius_step": (0.02, 60.0),
    "radius_step_left": (0.02, 60.0),
    "radius_step_right": (-0.03, 60.0),
    "track_step": (0.15, 60.0),
    "eccentric_left": (0.01, 0.02),
    "eccentric_right": (0.01, 0.02),
    "missed_left": (0.02, 0.0),
    "missed_right": (0.02, 0.0),
    "gnss_latency": (0.15,),
    "fix_smoothing": (0.9,),
    "heading_latency": (0.15,),
    "heading_smoothing": (0.9,),
    "clock_skew": (300.0,),
    "hard_iron": (8.0, -12.0, 0.0),
    "soft_iron": (3.0, -2.0, 0.0),
    "heading_drift": (20.0,),
    "heading_scale": (0.002,),
    "speed_field": (4.0,),
    "heading_step": (5.0, 60.0),
    "base_shift": (0.5, -0.3, 60.0),
    "local_field": (15.0, -24.4, -9.0, 3.0),
}
"""Of each effect as in the field, parameters in order."""
SHAPED: tuple[tuple[str, tuple[float, ...]], ...] = (
    ("fix_smoothing", (0.3,)),
    ("heading_smoothing", (2.5,)),
    ("missed_left", (0.02, 9.0)),
    ("missed_left", (-0.03, 7.0)),
    ("missed_right", (0.02, 9.0)),
    ("hard_iron", (8.0, -12.0, 20.0)),
    ("hard_iron", (-28.0, 19.0, 20.0)),
    ("soft_iron", (3.0, -2.0, 20.0)),
    ("soft_iron", (12.0, -9.0, 8.0)),
)
"""Further ones, with shapes that are not at their own values."""
DURATIONS_S = {"clock_skew": 240.0}
"""Of the drives on which an effect needs longer to show."""
LEFT_OVER = 0.05
"""Share of the effect's innovation that may stay: terms of second order and the filter's own discretisation."""

each_effect = pytest.mark.parametrize("name", sorted(CATALOGUE))
each_case = pytest.mark.parametrize(("name", "truth"), [*sorted(SIZES.items()), *SHAPED])


def rms(values):
    return float(np.sqrt(np.nanmean(np.square(values))))


def named(name, values):
    return dict(zip((p.name for p in CATALOGUE[name].parameters), values, strict=True))


def scaled(name, values, factor):
    """Values times a factor; places, times and sizes stay."""
    return tuple(
        value if parameter.shape else factor * value
        for parameter, value in zip(CATALOGUE[name].parameters, values, strict=True)
    )


def test_every_effect_has_its_sizes():
    assert set(SIZES) == set(CATALOGUE)


@each_case
def test_held_at_the_truth_it_explains_what_it_does(name, truth):
    log = injected(name, truth, duration_s=DURATIONS_S.get(name, 120.0))
    without = innovations(log, name, named(name, scaled(name, truth, 0.0)))
    with_it = innovations(log, name, named(name, truth))
    for before, after, floor in zip(without, with_it, (1e-5, 1e-3), strict=True):
        assert rms(after) < max(LEFT_OVER * rms(before), floor)
    assert rms(without[0]) > 1e-3 or rms(without[1]) > 0.01


@each_case
def test_the_wrong_sign_makes_it_worse(name, truth):
    log = injected(name, truth, duration_s=DURATIONS_S.get(name, 120.0))
    against = innovations(log, name, named(name, scaled(name, truth, -1.0)))
    nothing = innovations(log, name, named(name, scaled(name, truth, 0.0)))
    worse = [rms(a) / max(rms(b), 1e-4) for a, b in zip(against, nothing, strict=True)]
    assert max(worse) > 1.5


@each_effect
def test_held_at_zero_it_is_the_identity(name):
    log = injected(name, tuple(0.0 for _ in SIZES[name]))
    heading, fixes = innovations(log, name, named(name, scaled(name, SIZES[name], 0.0)))
    assert rms(heading) < 1e-5
    assert rms(fixes) < 2e-3


@each_effect
def test_columns_have_the_rows_of_their_port(name):
    log = injected(name, SIZES[name])
    rows = {"heading": log.view.headings.t_s.size}
    rows |= dict.fromkeys(("antenna_forward", "antenna_left", "east", "north"), log.view.fixes.t_s.size)
    parameters = {p.name for p in CATALOGUE[name].parameters if not p.shape}
    seen = set()
    for column in CATALOGUE[name].columns(log.view, named(name, SIZES[name])):
        assert column.values.shape == (rows.get(column.port, log.view.steps.t_s.size),)
        assert np.all(np.isfinite(column.values))
        seen.add(column.parameter)
    assert seen == parameters


@each_case
def test_it_says_whether_its_columns_at_the_heading_follow_the_heading_and_its_values(name, truth):
    view, effect = injected("turn_slip", (0.0,)).view, CATALOGUE[name]
    turned = replace(view, headings=replace(view.headings, yaw_rad=1.01 * view.headings.yaw_rad + 0.1))
    values = named(name, truth)
    free = {one.name for one in effect.parameters if not one.shape}
    doubled = {key: 2.0 * value if key in free else value for key, value in values.items()}

    def at_the_heading(seen, at):
        return [column.values for column in effect.columns(seen, at) if column.port == "heading"]

    here = at_the_heading(view, values)
    others = [at_the_heading(turned, values), at_the_heading(view, doubled)]
    follows = any(not np.array_equal(a, b) for other in others for a, b in zip(here, other, strict=True))
    assert follows == effect.bends_heading


@each_effect
def test_it_is_described(name):
    effect = CATALOGUE[name]
    assert effect.name == name
    for text in (effect.title, effect.looks_like, effect.excited_by, effect.reference):
        assert len(text) > 8
    for parameter in effect.parameters:
        assert parameter.lower < 0.0 < parameter.upper or parameter.shape
        assert parameter.prior_sigma > 0.0
        assert parameter.shape or (parameter.default is None and parameter.unsaid is None)
        assert parameter.left_out is None or parameter.lower <= parameter.left_out <= parameter.upper
        assert parameter.hidden_sigma >= 0.0


@each_effect
def test_it_says_how_its_shapes_are_found(name):
    effect = CATALOGUE[name]
    shapes = {parameter.name: parameter for parameter in effect.parameters if parameter.shape}
    assert (effect.search == "none") == (not shapes)
    view = injected("lever_arm", SIZES["lever_arm"]).view
    grid = effect.shape_grid(view)
    assert bool(grid) == (effect.search == "scale")
    assert len(grid) <= 5
    for one in grid:
        assert set(one) == set(shapes)
        assert all(shapes[key].lower <= value <= shapes[key].upper for key, value in one.items())
    own = {key: shape.default for key, shape in shapes.items()}
    assert dict(own) in [dict(one) for one in grid] or None in own.values() or not shapes
    if effect.search in ("moment", "place"):
        ports = {column.port for column in effect.columns(view, named(name, SIZES[name]))}
        streams = {"heading": "headings", "east": "fixes", "north": "fixes"}
        assert {streams.get(port, "motion") for port in ports} == {effect.suspect_stream}


@each_effect
def test_the_truth_file_names_its_parameters(name):
    values = named(name, SIZES[name])
    own = {parameter.name: parameter.left_out for parameter in CATALOGUE[name].parameters}
    told = {key: value for key, value in values.items() if value != own[key]}
    assert CATALOGUE[name].physics(values).truth() == {name: told}
    assert CATALOGUE[name].physics(told).truth() == {name: told}


@pytest.mark.parametrize(("name", "truth"), SHAPED)
def test_the_truth_file_names_shapes_that_are_not_their_own(name, truth):
    values = named(name, truth)
    own = {parameter.name: parameter.left_out for parameter in CATALOGUE[name].parameters}
    assert CATALOGUE[name].physics(values).truth() == {
        name: {key: value for key, value in values.items() if value != own[key]}
    }


@each_effect
def test_it_is_parsed_from_the_command_line(name):
    text = f"{name}={','.join(str(v) for v in SIZES[name])}"
    effect, values = parse_effect(text)
    assert effect is CATALOGUE[name]
    assert tuple(values.values()) == SIZES[name]
    with pytest.raises(UsageError, match=name):
        parse_effect(f"{name}=1,2,3,4,5")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("hard_iron=3,4", {"cos_deg": 3.0, "sin_deg": 4.0, "tau_s": 0.0}),
        ("hard_iron=3,4,20", {"cos_deg": 3.0, "sin_deg": 4.0, "tau_s": 20.0}),
        ("soft_iron=3,4", {"cos2_deg": 3.0, "sin2_deg": 4.0, "tau_s": 0.0}),
        ("missed_left=0.02", {"ratio": 0.02, "above_radps": 0.0}),
        ("speed_offset=0.05", {"mps": 0.05, "above_mps": 0.02}),
        ("missed_right=0.02,8", {"ratio": 0.02, "above_radps": 8.0}),
    ],
)
def test_shapes_with_a_value_of_their_own_may_be_left_out(text, expected):
    assert parse_effect(text)[1] == expected


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("hard_iron=3", r"takes 2 to 3 numbers: hard_iron=cos_deg,sin_deg\[,tau_s\]"),
        ("hard_iron=3,4,5,6", "takes 2 to 3 numbers"),
        ("hard_iron=3,x", "takes 2 to 3 numbers"),
        ("missed_left", r"missed_left=ratio\[,above_radps\]"),
        ("heading_step=5", "takes 2 numbers: heading_step=deg,at_s"),
        ("local_field=5", "takes 4 numbers"),
    ],
)
def test_all_others_have_to_be_told(text, told):
    with pytest.raises(UsageError, match=told):
        parse_effect(text)


def test_an_unknown_name_is_told_the_known_ones():
    with pytest.raises(UsageError, match="lever_arm"):
        parse_effect("lever_am=1,2")
