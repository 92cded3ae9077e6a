"""Every effect of the catalogue: its columns against its physics, and its description.

With the truth held fixed, a noiseless log leaves no innovation. If a column had a wrong sign, the innovation would
double; if it stood at the wrong port, it would stay.
"""

from __future__ import annotations

import numpy as np
import pytest

from sccal.effects.catalogue import CATALOGUE, parse_effect
from sccal.errors import UsageError
from tests.effects.harness import injected, innovations

SIZES: dict[str, tuple[float, ...]] = {
    "lever_arm": (0.3, -0.1),
    "turn_slip": (0.2,),
    "turn_scrub": (0.1,),
    "side_slip": (0.1,),
    "speed_slip": (0.03,),
    "brake_slip": (0.05,),
    "drive_slip": (0.05,),
    "slope": (1.0,),
    "roll_slip": (0.1,),
    "radius_drift": (0.1,),
    "radius_step": (0.02, 60.0),
    "eccentric_left": (0.01, 0.02),
    "eccentric_right": (0.01, 0.02),
    "missed_left": (0.02,),
    "missed_right": (0.02,),
    "gnss_latency": (0.15,),
    "heading_latency": (0.15,),
    "clock_skew": (300.0,),
    "hard_iron": (8.0, -12.0),
    "soft_iron": (3.0, -2.0),
    "heading_drift": (20.0,),
    "speed_field": (4.0,),
    "heading_step": (5.0, 60.0),
    "base_shift": (0.5, -0.3, 60.0),
    "local_field": (15.0, -24.4, -9.0, 3.0),
}
"""Of each effect as in the field, parameters in order."""
DURATIONS_S = {"clock_skew": 240.0}
"""Of the drives on which an effect needs longer to show."""
LEFT_OVER = 0.05
"""Share of the effect's innovation that may stay: terms of second order and the filter's own discretisation."""

each_effect = pytest.mark.parametrize("name", sorted(CATALOGUE))


def rms(values):
    return float(np.sqrt(np.nanmean(np.square(values))))


def named(name, values):
    return dict(zip((p.name for p in CATALOGUE[name].parameters), values, strict=True))


def scaled(name, factor):
    """The usual size times a factor; places, times and sizes stay."""
    return tuple(
        value if parameter.shape else factor * value
        for parameter, value in zip(CATALOGUE[name].parameters, SIZES[name], strict=True)
    )


@each_effect
def test_held_at_the_truth_it_explains_what_it_does(name):
    truth = scaled(name, 1.0)
    log = injected(name, truth, duration_s=DURATIONS_S.get(name, 120.0))
    nothing = tuple(0.0 if not p.shape else v for p, v in zip(CATALOGUE[name].parameters, truth, strict=True))
    without = innovations(log, name, named(name, nothing))
    with_it = innovations(log, name, named(name, truth))
    for before, after, floor in zip(without, with_it, (1e-5, 1e-3), strict=True):
        assert rms(after) < max(LEFT_OVER * rms(before), floor)
    assert rms(without[0]) > 1e-3 or rms(without[1]) > 0.01


@each_effect
def test_the_wrong_sign_makes_it_worse(name):
    truth = scaled(name, 1.0)
    log = injected(name, truth, duration_s=DURATIONS_S.get(name, 120.0))
    against = innovations(log, name, named(name, scaled(name, -1.0)))
    nothing = innovations(log, name, named(name, scaled(name, 0.0)))
    worse = [rms(a) / max(rms(b), 1e-4) for a, b in zip(against, nothing, strict=True)]
    assert max(worse) > 1.5


@each_effect
def test_held_at_zero_it_is_the_identity(name):
    log = injected(name, tuple(0.0 for _ in SIZES[name]))
    heading, fixes = innovations(log, name, named(name, scaled(name, 0.0)))
    assert rms(heading) < 1e-5
    assert rms(fixes) < 2e-3


@each_effect
def test_columns_have_the_rows_of_their_port(name):
    log = injected(name, scaled(name, 1.0))
    rows = {"heading": log.view.headings.t_s.size}
    rows |= dict.fromkeys(("antenna_forward", "antenna_left", "east", "north"), log.view.fixes.t_s.size)
    parameters = {p.name for p in CATALOGUE[name].parameters if not p.shape}
    seen = set()
    for column in CATALOGUE[name].columns(log.view, named(name, SIZES[name])):
        assert column.values.shape == (rows.get(column.port, log.view.steps.t_s.size),)
        assert np.all(np.isfinite(column.values))
        seen.add(column.parameter)
    assert seen == parameters


@each_effect
def test_it_is_described(name):
    effect = CATALOGUE[name]
    assert effect.name == name
    for text in (effect.title, effect.looks_like, effect.excited_by, effect.reference):
        assert len(text) > 8
    for parameter in effect.parameters:
        assert parameter.lower < 0.0 < parameter.upper or parameter.shape
        assert parameter.prior_sigma > 0.0


@each_effect
def test_the_truth_file_names_its_parameters(name):
    values = named(name, SIZES[name])
    assert CATALOGUE[name].physics(values).truth() == {name: values}


@each_effect
def test_it_is_parsed_from_the_command_line(name):
    text = f"{name}={','.join(str(v) for v in SIZES[name])}"
    effect, values = parse_effect(text)
    assert effect is CATALOGUE[name]
    assert tuple(values.values()) == SIZES[name]
    with pytest.raises(UsageError, match=name):
        parse_effect(f"{name}=1,2,3,4,5")


def test_an_unknown_name_is_told_the_known_ones():
    with pytest.raises(UsageError, match="lever_arm"):
        parse_effect("lever_am=1,2")
