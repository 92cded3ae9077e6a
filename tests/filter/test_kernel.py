"""The kernel against the plain oracle, and laws that it must keep by itself."""

from __future__ import annotations

import numpy as np
import pytest

from sccal.filter import kernel, measurement
from sccal.filter import layout as K
from tests.filter import oracle
from tests.filter.events import believed, make, memory, output

ALL_MOTION = (K.PORT_ALONG, K.PORT_SIDE, K.PORT_TURN, K.PORT_RIGHT_WHEEL, K.PORT_LEFT_WHEEL)
ALL_FIX = (K.PORT_ANTENNA_FORWARD, K.PORT_ANTENNA_LEFT, K.PORT_EAST, K.PORT_NORTH)


def run(events, columns, model, x, P, fixes_teach=True):
    belief, out, kept = believed(x, P), output(events), memory(events)
    kernel.forward(events, columns, model, belief, kept, 0, events.t_s.size, fixes_teach, out)
    return np.concatenate((belief.x, belief.p)), belief.covariance(), out, kept


@pytest.mark.parametrize(
    "case",
    [
        {},
        {"use_offset": False},
        {"coloured": False},
        {"gate": 6.0},
        {"motion_ports": ALL_MOTION},
        {"heading_columns": 3},
        {"heading_columns": 2, "bent": True},
        {"fix_ports": ALL_FIX},
        {"motion_ports": ALL_MOTION, "heading_columns": 2, "fix_ports": ALL_FIX},
        {"motion_ports": ALL_MOTION, "heading_columns": 2, "fix_ports": ALL_FIX, "correlated": True},
        {"soft": True, "outliers": 0.05},
        {"soft": True, "outliers": 0.05, "coloured": False},
        {"motion_ports": ALL_MOTION, "heading_columns": 2, "fix_ports": ALL_FIX, "soft": True, "outliers": 0.05},
        {"heading_columns": 2, "bent": True, "fix_ports": ALL_FIX, "soft": True, "correlated": True},
        {"fix_ports": ALL_FIX, "arms_elsewhere": True},
    ],
    ids=str,
)
def test_agrees_with_the_oracle_to_1e_9(case):
    events, columns, model, x0, P0 = make(600, seed=3, **case)
    x, P, out, _ = run(events, columns, model, x0, P0)
    ox, oP, nu_h, nu_f, ok_h, ok_f, cost = oracle.run(events, columns, model, x0, P0)
    sigma = np.sqrt(np.maximum(np.diag(oP), 1e-30))
    assert np.all(out.heading_ok == ok_h)
    assert np.all(out.fix_ok == ok_f)
    if "gate" in case or "outliers" in case:
        assert 0 < (~ok_f).sum() + (~ok_h).sum() < 50
    np.testing.assert_allclose(out.total, cost, rtol=1e-9)
    np.testing.assert_allclose(x, ox, rtol=0, atol=1e-9)
    np.testing.assert_allclose(P, oP, rtol=0, atol=1e-9 * np.outer(sigma, sigma).max())
    np.testing.assert_allclose(P / np.outer(sigma, sigma), oP / np.outer(sigma, sigma), rtol=0, atol=1e-8)
    np.testing.assert_allclose(out.heading_nu, nu_h, rtol=0, atol=1e-9)
    np.testing.assert_allclose(out.fix_nu, nu_f, rtol=0, atol=1e-9)


def test_stays_exact_against_extended_precision():
    events, columns, model, x0, P0 = make(4_000, seed=8)
    x, P, _, _ = run(events, columns, model, x0, P0)
    ox, oP, *_ = oracle.run(events, columns, model, x0, P0, kind=np.longdouble)
    sigma = np.sqrt(np.diag(oP).astype(float))
    assert np.max(np.abs((x - ox).astype(float)) / sigma) < 1e-8
    assert np.max(np.abs((P - oP).astype(float)) / np.outer(sigma, sigma)) < 1e-8


def test_covariance_stays_symmetric_and_positive_over_three_million_events():
    events, columns, model, x, P = make(1_000_000, seed=1)
    out, kept = output(events), memory(events)
    belief = believed(x, P)
    for _ in range(3):
        belief.x[:3] = 0.1, -0.1, 0.02
        kept[:2] = events.t_s[0]
        kernel.forward(events, columns, model, belief, kept, 0, events.t_s.size, True, out)
        x, P = belief.x, belief.core
        assert np.array_equal(P, P.T)
        sigma = np.sqrt(np.diag(P))
        assert np.all(np.isfinite(x))
        assert np.linalg.eigvalsh(P / np.outer(sigma, sigma)).min() > 0.0


def test_columns_held_at_zero_change_nothing():
    events, columns, model, x0, P0 = make(500, seed=4, motion_ports=ALL_MOTION, heading_columns=2, fix_ports=ALL_FIX)
    n = K.BASE_STATES
    x0[n:] = 0.0
    P0[n:, n:] = 0.0
    plain_events, plain_columns, plain_model, _, _ = make(500, seed=4)
    plain_events = events
    x, P, out, _ = run(events, columns, model, x0, P0)
    px, pP, pout, _ = run(plain_events, plain_columns, plain_model, x0[:n].copy(), P0[:n, :n].copy())
    np.testing.assert_allclose(x[:n], px, rtol=0, atol=1e-12)
    np.testing.assert_allclose(P[:n, :n], pP, rtol=0, atol=1e-12)
    np.testing.assert_allclose(out.fix_nu, pout.fix_nu, rtol=0, atol=1e-12)
    assert np.all(x[n:] == 0.0)


def test_a_pass_in_parts_equals_a_pass_in_one():
    events, columns, model, x0, P0 = make(900, seed=5)
    whole_x, whole_P, whole_out, _ = run(events, columns, model, x0, P0)
    belief, out, kept = believed(x0, P0), output(events), memory(events)
    for first, last in ((0, 1), (1, 400), (400, 401), (401, 900)):
        kernel.forward(events, columns, model, belief, kept, first, last, True, out)
    assert np.array_equal(belief.x, whole_x)
    assert np.array_equal(belief.covariance(), whole_P)
    assert np.array_equal(out.fix_nu, whole_out.fix_nu)


def test_withheld_fixes_teach_nothing():
    events, columns, model, x0, P0 = make(500, seed=6)
    x, P, _, _ = run(events, columns, model, x0, P0, fixes_teach=False)
    moved = events._replace(fix_east_m=events.fix_east_m + 1e3)
    again_x, again_P, out, _ = run(moved, columns, model, x0, P0, fixes_teach=False)
    assert np.array_equal(x, again_x)
    assert np.array_equal(P, again_P)
    assert np.nanmin(out.fix_nu[:, 0]) > 900.0


@pytest.mark.parametrize(("right", "left", "turns"), [(1.0, 0.5, 1), (0.5, 1.0, -1)])
def test_a_faster_right_wheel_turns_counter_clockwise(right, left, turns):
    events, columns, model, x, P = make(2)
    events = events._replace(
        right_rad=np.array([0.0, right]),
        left_rad=np.array([0.0, left]),
        heading_row=np.full(2, -1, np.int32),
        fix_row=np.full(2, -1, np.int32),
    )
    after, _, _, _ = run(events, columns, model, x, P)
    assert np.sign(after[2] - x[2]) == turns
    assert after[0] > x[0]


@pytest.mark.parametrize(
    ("port", "east", "north"),
    [
        (K.PORT_ANTENNA_FORWARD, 0.0, 1.0),
        (K.PORT_ANTENNA_LEFT, -1.0, 0.0),
        (K.PORT_EAST, 1.0, 0.0),
        (K.PORT_NORTH, 0.0, 1.0),
    ],
)
def test_antenna_ports_point_where_they_say(port, east, north):
    """Robot at the origin heading north: forward is north, left is west."""
    events, columns, model, x, P = make(10, fix_ports=(port,))
    x[:] = 0.0
    x[2], x[3:6], x[10] = np.pi / 2, (0.08, 0.08, 0.7), 1.0
    still = np.zeros(10)
    columns = columns._replace(fix=np.ones_like(columns.fix))
    events = events._replace(right_rad=still, left_rad=still, heading_row=np.full(10, -1, np.int32))
    _, _, out, _ = run(events, columns, model, x, P * 1e-12)
    np.testing.assert_allclose(out.antenna[0], [east, north], atol=1e-9)


@pytest.mark.parametrize(
    ("port", "d_east", "d_north", "d_yaw"),
    [
        (K.PORT_ALONG, 0.0, 0.01, 0.0),
        (K.PORT_SIDE, -0.01, 0.0, 0.0),
        (K.PORT_TURN, 0.0, 0.0, 0.01),
        (K.PORT_RIGHT_WHEEL, 0.0, 0.005, 0.01 / 0.7),
        (K.PORT_LEFT_WHEEL, 0.0, 0.005, -0.01 / 0.7),
    ],
)
def test_motion_ports_move_where_they_say(port, d_east, d_north, d_yaw):
    """Robot heading north: along is north, side (left) is west, turn is counter-clockwise."""
    events, columns, model, x, P = make(2, motion_ports=(port,))
    x[:] = 0.0
    x[2], x[3:6], x[10] = np.pi / 2, (0.08, 0.08, 0.7), 1.0
    nothing = np.full(2, -1, np.int32)
    tiny = np.array([0.0, 1e-15])
    columns = columns._replace(motion=np.array([[0.0], [0.01]]))
    events = events._replace(right_rad=tiny, left_rad=tiny, heading_row=nothing, fix_row=nothing)
    after, _, _, _ = run(events, columns, model, x, P)
    np.testing.assert_allclose(after[:3] - x[:3], [d_east, d_north, d_yaw], atol=1e-4)
    assert np.all(np.sign(np.round(after[:3] - x[:3], 4)) == np.sign([d_east, d_north, d_yaw]))


def test_heading_offset_is_reading_minus_heading():
    events, columns, model, x, P = make(40, coloured=False)
    still = np.zeros(40)
    x[2] = 1.0
    P[2, 2] = 1e-12
    events = events._replace(right_rad=still, left_rad=still, fix_row=np.full(40, -1, np.int32))
    events = events._replace(yaw_rad=np.full(events.yaw_rad.size, 1.25))
    after, _, _, _ = run(events, columns, model, x, P)
    assert after[6] == pytest.approx(0.25, abs=1e-3)


def test_a_filter_that_locked_itself_out_recovers():
    events, columns, model, x0, P0 = make(6000, seed=2)
    t = events.t_s[events.fix_row >= 0]
    jump = np.where(t > t[-1] / 2, 8.0, 0.0)
    model = model._replace(heading_gate=25.0, fix_gate=27.6, recover_count=5.0, recover_s=3.0)
    events = events._replace(fix_east_m=events.fix_east_m + jump)
    _, P, out, kept = run(events, columns, model, x0, P0)
    after = t > t[-1] / 2
    rejected = ~out.fix_ok[after]
    assert kept[K.MEM_RECOVERIES] == 1
    assert 5 <= rejected.sum() < 4.0 / np.median(np.diff(t))
    assert np.abs(out.fix_nu[-20:, 0]).max() < 0.2
    assert np.sqrt(P[0, 0]) < 0.1


def test_weighed_softly_it_comes_back_from_a_jump_as_well():
    events, columns, model, x0, P0 = make(6000, seed=2, soft=True)
    t = events.t_s[events.fix_row >= 0]
    after = t > t[-1] / 2
    model = model._replace(recover_count=5.0, recover_s=3.0)
    _, P, out, kept = run(events._replace(fix_east_m=events.fix_east_m + 8.0 * after), columns, model, x0, P0)
    assert kept[K.MEM_RECOVERIES] == 1
    assert 5 <= (~out.fix_ok[after]).sum() < 4.0 / np.median(np.diff(t))
    assert np.abs(out.fix_nu[-20:, 0]).max() < 0.2
    assert np.sqrt(P[0, 0]) < 0.1


def test_weighed_softly_it_comes_back_from_a_turned_compass_as_well():
    events, columns, model, x0, P0 = make(6000, seed=2, soft=True)
    t = events.t_s[events.heading_row >= 0]
    after = t > t[-1] / 2
    model = model._replace(recover_count=5.0, recover_s=3.0)
    x, _, out, kept = run(events._replace(yaw_rad=events.yaw_rad + 1.0 * after), columns, model, x0, P0)
    assert kept[K.MEM_RECOVERIES] == 1
    assert x[6] == pytest.approx(1.3, abs=0.1)
    assert np.abs(out.heading_nu[-20:]).max() < 0.1


def test_weighed_softly_a_wild_measurement_teaches_nothing():
    events, columns, model, x0, P0 = make(3000, seed=2, soft=True)
    wild = np.arange(events.fix_east_m.size) % 40 == 39
    x, P, _, _ = run(events, columns, model, x0, P0)
    moved, spread, out, kept = run(events._replace(fix_east_m=events.fix_east_m + 1e3 * wild), columns, model, x0, P0)
    assert np.array_equal(~out.fix_ok, wild)
    assert kept[K.MEM_RECOVERIES] == 0
    assert np.all(np.abs(moved - x) < 2.0 * np.sqrt(np.diag(P)))
    assert np.all(np.diag(spread) > 0.99 * np.diag(P))


def test_a_few_outliers_are_rejected_and_do_not_open_the_filter():
    events, columns, model, x0, P0 = make(6000, seed=2)
    model = model._replace(heading_gate=25.0, fix_gate=27.6, recover_count=5.0, recover_s=3.0)
    east = events.fix_east_m.copy()
    bad = np.arange(100, east.size, 90)
    east[bad] += 5.0
    x, _, out, kept = run(events._replace(fix_east_m=east), columns, model, x0, P0)
    clean_x, _, _, _ = run(events, columns, model, x0, P0)
    assert np.all(~out.fix_ok[bad])
    assert (~out.fix_ok).sum() <= bad.size + 3
    assert kept[K.MEM_RECOVERIES] == 0
    assert abs(x[3] - clean_x[3]) < 1e-5


@pytest.mark.parametrize("angle", [-10.0, -np.pi, -0.1, 0.0, 3.0, np.pi, 50.0])
def test_angles_wrap_into_half_open_turn(angle):
    wrapped = measurement.wrap_angle(angle)
    assert -np.pi <= wrapped < np.pi
    assert np.cos(wrapped) == pytest.approx(np.cos(angle))
    assert np.sin(wrapped) == pytest.approx(np.sin(angle), abs=1e-9)
