"""Made-up events for the kernel: a drive with turns, and measurements consistent with it."""

from __future__ import annotations

import numpy as np

from sccal.filter import layout as K


def make(
    count: int,
    seed: int = 0,
    motion_ports: tuple[int, ...] = (),
    heading_columns: int = 0,
    fix_ports: tuple[int, ...] = (),
    use_offset: bool = True,
    coloured: bool = True,
    gate: float = 1e9,
    bent: bool = False,
    arms_elsewhere: bool = False,
    soft: bool = False,
    outliers: float = 0.0,
    correlated: bool = False,
):
    """(events, columns, model, x, P): everything that a pass over ``count`` events needs.

    ``outliers`` is the share of readings and fixes that are far off; ``correlated`` priors let every core state and
    every parameter know something of each other.
    """
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.005, 0.02, count))
    speed, turn = 7.0 + np.sin(0.2 * t), 3.0 * np.sin(0.31 * t)
    dt = np.diff(t, prepend=t[0])
    right, left = (speed + turn) * dt, (speed - turn) * dt
    heading_row = np.full(count, -1, dtype=np.int32)
    heading_row[2::3] = np.arange(heading_row[2::3].size)
    fix_row = np.full(count, -1, dtype=np.int32)
    fix_row[5::7] = np.arange(fix_row[5::7].size)
    h, f = int((heading_row >= 0).sum()), int((fix_row >= 0).sum())
    params = len(motion_ports) + heading_columns + len(fix_ports)
    columns = K.Columns(
        motion=rng.normal(0.0, 0.01, (count, len(motion_ports))),
        motion_port=np.array(motion_ports, dtype=np.int32),
        motion_param=np.arange(len(motion_ports), dtype=np.int32),
        heading=rng.normal(0.0, 1.0, (h, heading_columns)),
        heading_param=np.arange(len(motion_ports), len(motion_ports) + heading_columns, dtype=np.int32),
        heading_known=rng.normal(0.0, 0.01, h) if bent else np.zeros(h),
        heading_slope=rng.normal(0.0, 0.05, h) if bent else np.zeros(h),
        heading_at=rng.normal(0.0, 0.1, h) if bent else np.zeros(h),
        fix=rng.normal(0.0, 1.0, (f, len(fix_ports))),
        fix_port=np.array(fix_ports, dtype=np.int32),
        fix_param=np.arange(len(motion_ports) + heading_columns, params, dtype=np.int32),
        fix_at=np.zeros(0),
    )
    n = K.BASE_STATES + params
    theta = np.cumsum((right - left) * 0.08 / 0.7)
    step = 0.5 * (right + left) * 0.08
    east, north = np.cumsum(step * np.cos(theta)), np.cumsum(step * np.sin(theta))
    if arms_elsewhere:
        turns = 2.0 * np.pi * rng.integers(-1, 2, f)
        elsewhere = theta[fix_row >= 0] + rng.normal(0.0, 0.1, f) + turns
        columns = columns._replace(fix_at=np.where(rng.random(f) < 0.8, elsewhere, np.nan))
    far_heading, far_fix = rng.random(h) < outliers, rng.random(f) < outliers
    events = K.Events(
        t_s=t,
        right_rad=right,
        left_rad=left,
        right_clear_rad=right,
        left_clear_rad=left,
        loose_m2=np.where(rng.random(count) < 0.01, 1e-4, 0.0),
        heading_row=heading_row,
        fix_row=fix_row,
        out_row=np.where(np.arange(count) % 10 == 0, np.arange(count) // 10, -1).astype(np.int32),
        yaw_rad=theta[heading_row >= 0] + 0.3 + rng.normal(0.0, 0.01, h) + 0.1 * far_heading,
        yaw_var_rad2=rng.uniform(0.5e-4, 2e-4, h),
        fix_east_m=east[fix_row >= 0] + rng.normal(0.0, 0.02, f) + 0.25 * far_fix,
        fix_north_m=north[fix_row >= 0] + rng.normal(0.0, 0.02, f),
        fix_var_east_m2=rng.uniform(1e-4, 4e-4, f),
        fix_var_north_m2=rng.uniform(1e-4, 4e-4, f),
        fix_cov_m2=rng.uniform(-0.5e-4, 0.5e-4, f),
    )
    walk = np.zeros(K.BASE_STATES)
    walk[3:7] = (1e-12, 1e-12, 1e-10, 1e-8)
    model = K.Model(
        slip2=1e-5,
        heading_coloured_var=4e-5 if coloured else 0.0,
        heading_tau_s=15.0,
        fix_coloured_var=1e-4 if coloured else 0.0,
        fix_tau_s=40.0,
        walk=walk,
        linear=np.zeros(3),
        lower=np.array([0.04, 0.04, 0.2]),
        upper=np.array([0.16, 0.16, 3.0]),
        heading_gate=gate,
        fix_gate=gate,
        soft_gate=soft,
        recover_count=1e9,
        recover_s=1e9,
        use_offset=use_offset,
    )
    x = np.zeros(n)
    x[:7] = 0.1, -0.1, 0.02, 0.081, 0.079, 0.72, 0.28
    x[K.BASE_STATES :] = rng.normal(0.0, 0.05, params)
    P = np.diag(
        [0.1, 0.1, 0.01, 1e-5, 1e-5, 1e-2, 0.1 if use_offset else 0.0]
        + [model.heading_coloured_var, model.fix_coloured_var, model.fix_coloured_var]
        + [1e-2] * params
    )
    if correlated:
        sigma = np.sqrt(np.diag(P))
        mixing = np.eye(n) + 0.3 * rng.normal(size=(n, n)) / np.sqrt(n)
        P = np.outer(sigma, sigma) * (mixing @ mixing.T)
    return events, columns, model, x, P


def output(events: K.Events) -> K.Output:
    h, f, m = events.yaw_rad.size, events.fix_east_m.size, int(events.out_row.max()) + 1
    return K.Output(
        state=np.zeros((m, 7)),
        sigma=np.zeros((m, 7)),
        heading_nu=np.full(h, np.nan),
        heading_var=np.full(h, np.nan),
        heading_ok=np.zeros(h, dtype=bool),
        fix_nu=np.full((f, 2), np.nan),
        fix_var=np.full((f, 3), np.nan),
        fix_ok=np.zeros(f, dtype=bool),
        antenna=np.full((f, 2), np.nan),
        total=np.zeros(2),
    )


def believed(x: np.ndarray, P: np.ndarray) -> K.Belief:
    """The belief of a state (n,) and a covariance (n, n) that hold core state and parameters together."""
    n = K.BASE_STATES
    empty = np.zeros((n, x.size - n))
    return K.Belief(x[:n].copy(), x[n:].copy(), P[:n, :n], empty, P[n:, n:]).begun(P)


def memory(events: K.Events) -> np.ndarray:
    kept = np.zeros(K.MEMORY_SIZE)
    kept[:2] = events.t_s[0]
    return kept
