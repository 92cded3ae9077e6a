"""The one-pass scores against the filter itself with each candidate really set."""

from __future__ import annotations

import numpy as np
import pytest

from sccal.filter import kernel
from sccal.filter import layout as K
from sccal.filter.scoring import score
from tests.filter.events import make, memory, output

MOTION = (K.PORT_ALONG, K.PORT_SIDE, K.PORT_TURN, K.PORT_RIGHT_WHEEL, K.PORT_LEFT_WHEEL)
FIX = (K.PORT_ANTENNA_FORWARD, K.PORT_ANTENNA_LEFT, K.PORT_EAST, K.PORT_NORTH)
COUNT = 700


def split(inside: int):
    """Events, columns at some ports in the filter (``inside`` of each room), and columns at all ports as candidates."""
    events, candidates, _, _, _ = make(COUNT, seed=9, motion_ports=MOTION, heading_columns=2, fix_ports=FIX)
    _, columns, model, x, P = make(
        COUNT, seed=21, motion_ports=MOTION[:inside], heading_columns=min(inside, 1), fix_ports=FIX[:inside]
    )
    return events, columns, candidates, model, x, P


def filtered(events, columns, candidates, model, x, P, values):
    """Innovations of a filter that carries the candidates as parameters fixed at ``values``."""
    held = x.size - K.BASE_STATES
    wide = K.Columns(
        motion=np.hstack([columns.motion, candidates.motion]),
        motion_port=np.concatenate([columns.motion_port, candidates.motion_port]),
        motion_param=np.concatenate([columns.motion_param, candidates.motion_param + np.int32(held)]),
        heading=np.hstack([columns.heading, candidates.heading]),
        heading_param=np.concatenate([columns.heading_param, candidates.heading_param + np.int32(held)]),
        fix=np.hstack([columns.fix, candidates.fix]),
        fix_port=np.concatenate([columns.fix_port, candidates.fix_port]),
        fix_param=np.concatenate([columns.fix_param, candidates.fix_param + np.int32(held)]),
    )
    n = x.size + values.size
    big_x, big_P = np.concatenate([x, values]), np.zeros((n, n))
    big_P[: x.size, : x.size] = P
    walk = np.concatenate([model.walk, np.zeros(values.size)])
    out = output(events)
    kernel.forward(events, wide, model._replace(walk=walk), big_x, big_P, memory(events), 0, COUNT, True, out)
    return out


def consistent(events, columns, candidates, model, x, P, count):
    """The events with measurements that the filter expects from its own start, but for a tenth of their noise.

    The gains depend on the state a little, and so on a candidate, by an amount in proportion to the innovations: an
    order that the scores leave out, and small innovations leave out too.
    """
    certain = model._replace(walk=np.zeros(x.size), heading_coloured_var=0.0, fix_coloured_var=0.0)
    still = events._replace(loose_m2=np.zeros(COUNT))
    expected = filtered(still, columns, candidates, certain, x, 0.0 * P, np.zeros(count))
    rng = np.random.default_rng(5)
    return events._replace(
        yaw_rad=events.yaw_rad - expected.heading_nu + rng.normal(0.0, 0.001, events.yaw_rad.size),
        fix_east_m=expected.antenna[:, 0] + rng.normal(0.0, 0.002, events.fix_east_m.size),
        fix_north_m=expected.antenna[:, 1] + rng.normal(0.0, 0.002, events.fix_east_m.size),
    )


@pytest.mark.parametrize("inside", [0, 2])
def test_scores_are_the_derivatives_of_the_cost(inside):
    """u is minus half the slope of Σ ν²/S by each candidate, S as it is without it."""
    events, columns, candidates, model, x, P = split(inside)
    count = len(MOTION) + 2 + len(FIX)
    # The constants' derivatives at fixed values, so that gains do not depend on the candidates through them.
    model = model._replace(linear=x[3:6].copy(), slip2=0.0)
    events = consistent(events, columns, candidates, model, x, P, count)
    scores = score(events, columns, candidates, count, model, x, P, np.zeros(COUNT, dtype=np.int32))
    base = filtered(events, columns, candidates, model, x, P, np.zeros(count))

    def weighted(out):
        e, n = out.fix_nu[:, 0], out.fix_nu[:, 1]
        see, snn, sen = base.fix_var[:, 0], base.fix_var[:, 1], base.fix_var[:, 2]
        fixes = (snn * e**2 - 2 * sen * e * n + see * n**2) / (see * snn - sen**2)
        return float((out.heading_nu**2 / base.heading_var).sum() + fixes.sum())

    assert scores.cost[0] == pytest.approx(weighted(base), rel=1e-9)
    assert scores.count[0] == events.yaw_rad.size + 2 * events.fix_east_m.size
    for k in range(count):
        size = 1e-3 / np.sqrt(scores.information[0, k, k])
        step = np.zeros(count)
        step[k] = size
        more, less = (weighted(filtered(events, columns, candidates, model, x, P, s * step)) for s in (1.0, -1.0))
        scale = np.sqrt(scores.information[0, k, k])
        assert -0.25 * (more - less) / size == pytest.approx(scores.u[0, k], abs=0.02 * scale)
        curvature = 0.5 * (more + less - 2 * scores.cost[0]) / size**2
        assert curvature == pytest.approx(scores.information[0, k, k], rel=0.05)


def test_blocks_add_up_to_the_whole():
    events, columns, candidates, model, x, P = split(2)
    count = len(MOTION) + 2 + len(FIX)
    whole = score(events, columns, candidates, count, model, x, P, np.zeros(COUNT, dtype=np.int32))
    parts = score(events, columns, candidates, count, model, x, P, (np.arange(COUNT) // 100).astype(np.int32))
    assert parts.u.shape == (7, count)
    np.testing.assert_allclose(parts.u.sum(axis=0), whole.u[0], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(parts.information.sum(axis=0), whole.information[0], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(parts.information, np.swapaxes(parts.information, 1, 2))
    assert parts.count.sum() == whole.count[0]


def test_a_known_parameter_is_found_by_one_pass():
    """A heading column and an antenna to the left, put into the measurements: I⁻¹u gives both back."""
    events, columns, _, model, x, P = split(0)
    rng = np.random.default_rng(1)
    candidates = K.Columns(
        motion=np.zeros((COUNT, 0)),
        motion_port=np.zeros(0, dtype=np.int32),
        motion_param=np.zeros(0, dtype=np.int32),
        heading=rng.normal(0.0, 1.0, (events.yaw_rad.size, 1)),
        heading_param=np.array([0], dtype=np.int32),
        fix=np.ones((events.fix_east_m.size, 1)),
        fix_port=np.array([K.PORT_ANTENNA_LEFT], dtype=np.int32),
        fix_param=np.array([1], dtype=np.int32),
    )
    clean = score(events, columns, candidates, 2, model, x, P, np.zeros(COUNT, dtype=np.int32))
    moved = events._replace(yaw_rad=events.yaw_rad + 0.02 * candidates.heading[:, 0])
    found = score(moved, columns, candidates, 2, model, x, P, np.zeros(COUNT, dtype=np.int32))
    before = np.linalg.solve(clean.information[0], clean.u[0])
    after = np.linalg.solve(found.information[0], found.u[0])
    sigma = np.sqrt(np.diag(np.linalg.inv(found.information[0])))
    assert after[0] - before[0] == pytest.approx(0.02, abs=0.002)
    assert abs(after[1] - before[1]) < sigma[1]
