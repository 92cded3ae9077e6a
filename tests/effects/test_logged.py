"""Further columns of a log as causes: ports, signs and units, and how they are named."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from sccal.align import Series
from sccal.effects.logged import LoggedColumn, logged_effects
from sccal.errors import DataError, SccalError, UsageError
from sccal.evidence.extension import FreeEffects
from sccal.results.model import Range
from sccal.simulate.physics import Physics
from sccal.simulate.world import WheelPair
from tests.effects.harness import injected

NAME = "motor_current_a"
TRACK_M = 0.728
"""Of the simulated vehicle."""
WHERE = ("heading", "along", "yaw", "side", "pull")
PER_UNIT = {"heading": 0.8, "along": 0.02, "yaw": 0.02, "side": 0.02, "pull": 0.005}


def current(t_s):
    """Amperes, t_s from the start of the drive: as large as its mean, so its reference is zero."""
    return 2.0 + 1.5 * np.sin(0.21 * t_s) + np.cos(0.047 * t_s)


@dataclass(frozen=True)
class Caused(Physics):
    """What the docstring of sccal.effects.logged says, done to the robot and not to a column."""

    where: str

    def heading(self, state, reading_rad):
        return reading_rad + (np.radians(PER_UNIT["heading"]) * current(state.t_s) if self.where == "heading" else 0.0)

    def body(self, steps):
        middle = 0.5 * (steps.t_s[1:] + steps.t_s[:-1])
        side = PER_UNIT["side"] * current(middle) * steps.along_m if self.where == "side" else 0.0
        return replace(steps, side_m=steps.side_m + side)

    def wheel_travel(self, motion, travel_m):
        middle = 0.5 * (motion.t_s[1:] + motion.t_s[:-1])
        factor = 1.0 + PER_UNIT.get(self.where, 0.0) * current(middle)
        along, half = 0.5 * (travel_m.right + travel_m.left), 0.5 * (travel_m.right - travel_m.left)
        along = along / factor if self.where == "along" else along
        half = half / factor if self.where == "yaw" else half
        if self.where == "pull":
            half = half - 0.5 * TRACK_M * PER_UNIT["pull"] * current(middle) * along
        return WheelPair(left=along - half, right=along + half)


def log_of(where, monkeypatch):
    """A noiseless log with the cause in it, and the column beside it."""

    bent = SimpleNamespace(parameters=(SimpleNamespace(name="there"),), physics=lambda values: Caused(where))
    monkeypatch.setattr("tests.effects.harness.CATALOGUE", {"bent": bent})
    log = injected.__wrapped__("bent", (1.0,))
    t_s = np.arange(-1.0, 130.0, 0.05)
    return replace(log, view=replace(log.view, logged={NAME: Series(t_s + begun_s(log), current(t_s))}))


def begun_s(log):
    """When the drive began, on the logging clock."""
    clock = log.simulated.settings.clock
    return clock.start_utc_s - clock.host_epoch_offset_s


def effect_at(where, reference=0.0, spread=1.0):
    return LoggedColumn(where, NAME, Range(reference, spread))


def values_of(effect, view):
    (column,) = effect.columns(view, {effect.parameters[0].name: 0.0})
    assert column.parameter == effect.parameters[0].name
    return column


def true_between_steps(log, of_steps):
    """The cumulative true motion at the timeline's events, from the first on."""
    motion = log.simulated.motion
    cumulative = np.concatenate(([0.0], np.cumsum(of_steps)))
    at = np.interp(log.timeline.t_s - begun_s(log), motion.t_s, cumulative)
    return at - at[0]


def test_at_the_heading_a_unit_is_a_degree_counter_clockwise(monkeypatch):
    log = log_of("heading", monkeypatch)
    column = values_of(effect_at("heading"), log.view)
    assert column.port == "heading"
    true = log.simulated.motion.at(log.view.headings.t_s - begun_s(log)).yaw_rad
    offset = np.radians(log.simulated.settings.ahrs.heading_offset_deg)
    read = log.aligned.yaw_rad[log.timeline.heading_index]
    error = np.angle(np.exp(1j * (read - true - offset)))
    assert np.max(np.abs(error)) > np.radians(2.0)
    assert PER_UNIT["heading"] * column.values == pytest.approx(error, abs=1e-4)


@pytest.mark.parametrize(("where", "port"), [("along", "along"), ("yaw", "turn"), ("pull", "turn")])
def test_at_the_wheels_a_unit_is_a_share(where, port, monkeypatch):
    log = log_of(where, monkeypatch)
    column = values_of(effect_at(where), log.view)
    assert column.port == port
    steps = log.simulated.motion.steps
    by_wheels = log.view.steps.along_m if where == "along" else log.view.steps.turn_rad
    true = true_between_steps(log, steps.along_m if where == "along" else steps.turn_rad)
    missed = true - np.cumsum(by_wheels)
    assert np.max(np.abs(missed)) > 0.1
    left = missed - PER_UNIT[where] * np.cumsum(column.values)
    assert np.max(np.abs(left)) < 0.01 * np.max(np.abs(missed))


def test_at_the_side_a_unit_is_a_share_of_the_travel_to_the_left(monkeypatch):
    log = log_of("side", monkeypatch)
    column = values_of(effect_at("side"), log.view)
    assert column.port == "side"
    true = true_between_steps(log, log.simulated.motion.steps.side_m)
    assert np.max(np.abs(true)) > 0.5
    assert PER_UNIT["side"] * np.cumsum(column.values) == pytest.approx(true, abs=0.01 * np.max(np.abs(true)))


@pytest.mark.parametrize("where", WHERE)
def test_the_reference_is_taken_off(where, monkeypatch):
    log = log_of(where, monkeypatch)
    zero, two = (values_of(effect_at(where, reference), log.view).values for reference in (0.0, 2.0))
    steps = log.view.steps
    travel = steps.along_m
    unit = {"heading": np.radians(1.0), "along": travel, "yaw": steps.turn_rad, "side": travel, "pull": travel}[where]
    assert zero - two == pytest.approx(np.broadcast_to(2.0 * unit, zero.shape))


@pytest.mark.parametrize(
    ("mean", "spread", "reference"), [(300.0, 1.0, 300.0), (-300.0, 1.0, -300.0), (2.0, 1.0, 0.0), (0.0, 5.0, 0.0)]
)
def test_columns_count_from_zero_unless_they_are_far_from_it(mean, spread, reference):
    wave = np.sin(np.linspace(0.0, 40.0 * np.pi, 4001)[:-1]) * np.sqrt(2.0) * spread
    found = Range.of([mean + wave])
    assert found.reference == pytest.approx(reference, abs=1e-6)
    assert found.spread == pytest.approx(spread, rel=1e-3)


def test_the_reference_is_of_all_runs_together():
    cold, warm = (Series(np.arange(100.0), value + np.sin(np.arange(100.0))) for value in (280.0, 320.0))
    found = Range.of([cold.values, warm.values])
    assert found.reference == pytest.approx(300.0, abs=0.1)
    assert found.spread == pytest.approx(20.0, rel=0.01)
    alone, both = (
        logged_effects([{"temperature": cold}]),
        logged_effects([{"temperature": cold}, {"temperature": warm}]),
    )
    assert [one.name for one in alone] == [one.name for one in both] == [f"{where}~temperature" for where in WHERE]
    assert alone[0].range.reference == pytest.approx(280.0, abs=0.1)
    assert both[0].range == found


@pytest.mark.parametrize("where", WHERE)
def test_priors_are_of_one_standard_deviation_of_the_column(where):
    narrow, wide = (effect_at(where, spread=spread).parameters[0] for spread in (0.5, 5.0))
    assert narrow.prior_sigma == pytest.approx(10.0 * wide.prior_sigma)
    assert wide.prior_sigma * 5.0 == pytest.approx({"heading": 10.0, "pull": 0.02}.get(where, 0.1))
    assert 0.0 < narrow.matters < 0.1 * narrow.prior_sigma
    assert narrow.lower < -narrow.prior_sigma
    assert narrow.upper > narrow.prior_sigma
    assert narrow.unit == {"heading": "deg/unit", "pull": "rad/m/unit"}.get(where, "1/unit")


def test_a_column_that_never_changes_is_no_candidate():
    assert logged_effects([{"mode": Series(np.arange(5.0), np.full(5, 3.0))}]) == ()


@pytest.mark.parametrize("where", WHERE)
def test_a_run_without_the_column_has_none_of_it(where):
    view = injected("lever_arm", (0.0, 0.0)).view
    assert NAME not in view.logged
    column = values_of(effect_at(where, reference=300.0), view)
    assert column.values.size == (view.headings.t_s.size if where == "heading" else view.steps.t_s.size)
    assert np.all(column.values == 0.0)


@pytest.mark.parametrize("where", WHERE)
def test_it_cannot_be_simulated(where):
    effect = effect_at(where)
    with pytest.raises(UsageError, match=effect.name):
        effect.physics({effect.parameters[0].name: 1.0})


def test_it_is_named_by_port_and_column():
    plain = injected("lever_arm", (0.0, 0.0)).aligned
    t_s = plain.wheel_t_s
    aligned = replace(plain, extras={NAME: Series(t_s, current(t_s - t_s[0])), "x": Series(t_s, 300.0 + np.sin(t_s))})
    free = FreeEffects.named((f"heading~{NAME}", "lever_arm", "side~x"), aligned)
    assert free is not None
    assert [effect.name for effect, _ in free.parameters] == [f"heading~{NAME}", "lever_arm", "lever_arm", "side~x"]
    assert free.prior_sigmas[0] == pytest.approx(10.0 / aligned.extras[NAME].values.std())
    assert free.effects[2].effect.range.reference == pytest.approx(300.0, abs=0.1)
    with pytest.raises(DataError, match=f"no such further column that varies; there are .*heading~{NAME}"):
        FreeEffects.named(("heading~motor_current",), aligned)
    with pytest.raises(DataError, match="'upwards~x'"):
        FreeEffects.named(("upwards~x",), aligned)
    with pytest.raises(DataError, match="it has none at all"):
        FreeEffects.named((f"heading~{NAME}",), plain)
    with pytest.raises(SccalError, match="it has none at all"):
        FreeEffects.named((f"heading~{NAME}",))
