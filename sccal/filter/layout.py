"""What the kernel works on: states, ports, and the arrays that go in and out. See sccal.filter.kernel for the maths."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sccal.arrays import Bools, Floats, Rows

X, Y, THETA, RADIUS_RIGHT, RADIUS_LEFT, TRACK, OFFSET, HEADING_BIAS, EAST_BIAS, NORTH_BIAS = range(10)
BASE_STATES = 10
REPORTED_STATES = 7
CONSTANTS, WITH_OFFSET = slice(RADIUS_RIGHT, TRACK + 1), slice(RADIUS_RIGHT, OFFSET + 1)
"""What is learnt for good: R_r, R_l and L; and the heading offset after them."""

PORT_ALONG, PORT_SIDE, PORT_TURN, PORT_RIGHT_WHEEL, PORT_LEFT_WHEEL = range(5)
PORT_ANTENNA_FORWARD, PORT_ANTENNA_LEFT, PORT_EAST, PORT_NORTH = range(4)

# What a forward pass carries from one call to the next, beside state and covariance.
MEM_HEADING_T, MEM_FIX_T, MEM_FIX_REJECTED, MEM_FIX_SINCE, MEM_HEADING_REJECTED, MEM_HEADING_SINCE = range(6)
MEM_RECOVERIES, MEM_FIX_LEVEL, MEM_ACCEPTED_SINCE = 6, 7, 8
MEMORY_SIZE = 9


class Belief(NamedTuple):
    """What a pass believes: the core state, the effects' parameters, and how they hang together.

    P = core + slope · params · slopeᵀ is the covariance of the core state with the parameters marginalised, and
    slope · params its covariance with them (Friedland 1969; Bierman 1977, chapter VIII).
    """

    x: Floats  # (10,)
    p: Floats  # (m,) parameters of effects, in file units
    core: Floats  # (10, 10) covariance of the core state if the parameters were known
    slope: Floats  # (10, m) how the core state's estimate would move with each parameter
    params: Floats  # (m, m) covariance of the parameters

    def copied(self) -> Belief:
        """The same, in arrays of its own."""
        return Belief(*(part.copy() for part in self))

    def covariance(self) -> Floats:
        """(10 + m, 10 + m) of the core state and the parameters together."""
        together = self.slope @ self.params
        return np.block([[self.core + together @ self.slope.T, together], [together.T, self.params]])

    def begun(self, covariance: Floats) -> Belief:
        """The same means with another covariance (10 + m, 10 + m)."""
        n = BASE_STATES
        core, params, across = covariance[:n, :n].copy(), covariance[n:, n:].copy(), covariance[:n, n:]
        if not across.any():
            return Belief(self.x, self.p, core, np.zeros_like(across), params)
        slope = np.ascontiguousarray(across @ np.linalg.pinv(params, hermitian=True))
        core -= slope @ params @ slope.T
        return Belief(self.x, self.p, 0.5 * (core + core.T), slope, params)


class Events(NamedTuple):
    """One timeline, n events in order of time (see sccal.align.Timeline)."""

    t_s: Floats  # (n,)
    right_rad: Floats  # (n,) wheel angle since the event before
    left_rad: Floats  # (n,)
    right_clear_rad: Floats  # (n,) the same without slip: for the derivatives by R_r, R_l, L
    left_clear_rad: Floats  # (n,)
    loose_m2: Floats  # (n,) extra variance of each wheel's travel, m²
    heading_row: Rows  # (n,) int32, row of the heading reading here, or -1
    fix_row: Rows  # (n,) int32
    out_row: Rows  # (n,) int32, row of the output to fill here, or -1
    yaw_rad: Floats  # (h,) AHRS reading turned into enu
    yaw_var_rad2: Floats  # (h,) white part
    fix_east_m: Floats  # (f,)
    fix_north_m: Floats  # (f,)
    fix_var_east_m2: Floats  # (f,) white part
    fix_var_north_m2: Floats  # (f,)
    fix_cov_m2: Floats  # (f,)


class Columns(NamedTuple):
    """Effect columns by the room they act in; ``param`` is the place of the parameter in Belief.p."""

    motion: Floats  # (n, km), rows as Events.t_s
    motion_port: Rows  # (km,) int32
    motion_param: Rows  # (km,) int32
    heading: Floats  # (h, kh), rad per unit of the parameter
    heading_param: Rows  # (kh,) int32
    heading_known: Floats  # (h,) rad, added whatever the parameters are
    heading_slope: Floats  # (h,) how much more than by itself a reading turns with the robot: iron's deviation does
    heading_at: Floats  # (h,) rad, the heading about which that holds
    fix: Floats  # (f, kf)
    fix_port: Rows  # (kf,) int32
    fix_param: Rows  # (kf,) int32
    fix_at: Floats  # (f,) rad, the heading about which the antenna turns with the robot; NaN, or (0,): the current one


class Model(NamedTuple):
    """Everything that is a number: noise, walks, gates."""

    slip2: float  # m² per m of each wheel
    heading_coloured_var: float  # rad²
    heading_tau_s: float
    fix_coloured_var: float  # m²
    fix_tau_s: float
    walk: Floats  # (10,) variance rate of each core state, unit² per s (R_r, R_l, L and Ofs only)
    linear: Floats  # (3,) R_r, R_l, L at which their derivatives are taken; not positive: at the current estimate
    lower: Floats  # (3,) bounds of R_r, R_l, L
    upper: Floats  # (3,)
    heading_gate: float  # χ² with 1 degree of freedom
    fix_gate: float  # χ² with 2 degrees of freedom
    soft_gate: bool  # instead of the gates: weigh each measurement by its probability of being no outlier
    recover_count: float  # rejected in a row …
    recover_s: float  # … for so long: the filter opens up again
    use_offset: bool


class Output(NamedTuple):
    """What a pass fills; rows of one call range are written, the others left."""

    state: Floats  # (m, REPORTED_STATES)
    sigma: Floats  # (m, REPORTED_STATES), or (0, REPORTED_STATES) where nobody asks
    heading_nu: Floats  # (h,) rad, NaN where not reached
    heading_var: Floats  # (h,) innovation variance S
    heading_ok: Bools  # (h,) bool, accepted
    fix_nu: Floats  # (f, 2) m
    fix_var: Floats  # (f, 3) S_ee, S_nn, S_en
    fix_ok: Bools  # (f,) bool
    antenna: Floats  # (f, 2) m, predicted antenna (without the fix-error states)
    total: Floats  # (2,) negative log-likelihood: heading, fixes
