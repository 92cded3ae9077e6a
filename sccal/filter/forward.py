"""The forward filter over one aligned run: events, initial state and numbers put into the kernel's form."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass

import numpy as np

from sccal.align import Aligned, Timeline
from sccal.arrays import Bools, Floats
from sccal.compiled import is_compiled
from sccal.filter import kernel
from sccal.filter.columns import kernel_columns
from sccal.filter.layout import (
    BASE_STATES,
    CONSTANTS,
    EAST_BIAS,
    HEADING_BIAS,
    MEM_FIX_T,
    MEM_RECOVERIES,
    MEMORY_SIZE,
    NORTH_BIAS,
    OFFSET,
    RADIUS_LEFT,
    RADIUS_RIGHT,
    REPORTED_STATES,
    THETA,
    TRACK,
    Belief,
    Columns,
    Events,
    Model,
    Output,
    Y,
)
from sccal.filter.options import FilterOptions
from sccal.filter.start import Constants, Start
from sccal.results.noise import Noise

NUMERIC_RANGE = 5.0


@dataclass(frozen=True)
class ForwardPass:
    """What one pass left: the reported states at the output times, and every innovation."""

    timeline: Timeline
    state: Floats
    """(m, 7) x, y, θ, R_r, R_l, L, Ofs at Timeline.out_t_s."""
    sigma: Floats
    """(m, 7) standard deviations of the same; (0, 7) where nobody asked."""
    final_state: Floats
    """(n,) the kernel's whole state after the last event."""
    final_covariance: Floats
    """(n, n)"""
    heading_nu_rad: Floats
    heading_var_rad2: Floats
    heading_accepted: Bools
    fix_nu_m: Floats
    """(f, 2) east, north."""
    fix_var_m2: Floats
    """(f, 3) S_ee, S_nn, S_en."""
    fix_accepted: Bools
    recoveries: int
    nll_heading: float
    nll_fix: float
    prior_scale: float = 1.0
    """Of the effects' priors within the pass; state, covariance and ``nll`` at its end are those of the whole ones."""
    nll_prior: float = 0.0
    """What the likelihood lacks because they were narrower."""

    @property
    def nll(self) -> float:
        """Negative log-likelihood of all measurements."""
        return self.nll_heading + self.nll_fix + self.nll_prior


def say_if_compiling() -> None:
    """One line on standard error before the only slow first call."""
    if not is_compiled():
        print("compiling the filter (once, a few seconds) …", file=sys.stderr, flush=True)


def fix_nis(nu_m: Floats, var_m2: Floats) -> tuple[Floats, Floats]:
    """νᵀ S⁻¹ ν and det S (m⁴) of fixes, each (n,): innovations (n, 2), and S_ee, S_nn, S_en (n, 3)."""
    see, snn, sen = var_m2.T
    e, n = nu_m.T
    determinant = see * snn - sen**2
    return (snn * e**2 - 2.0 * sen * e * n + see * n**2) / determinant, determinant


class Filter:
    """The kernel bound to one run's events: start it, run it in parts, fork it."""

    def __init__(
        self,
        aligned: Aligned,
        timeline: Timeline,
        noise: Noise,
        options: FilterOptions,
        centre: Constants,
        clear: tuple[Floats, Floats],
        linear_at: Constants | None = None,
        columns: Columns | None = None,
        effects: int = 0,
        with_sigmas: bool = True,
    ) -> None:
        self.timeline = timeline
        self.options = options
        self.states = BASE_STATES + effects
        self.events = make_events(aligned, timeline, noise, clear)
        self.columns = kernel_columns((), timeline) if columns is None else columns
        self.model = make_model(centre, options, noise, linear_at)
        self.output = self.make_output(with_states=True, with_sigmas=with_sigmas)
        self.belief = Belief(
            np.zeros(BASE_STATES),
            np.zeros(effects),
            np.zeros((BASE_STATES, BASE_STATES)),
            np.zeros((BASE_STATES, effects)),
            np.zeros((effects, effects)),
        )
        self.memory = np.zeros(MEMORY_SIZE)
        self.position = 0
        self.blind: tuple[tuple[int, int], ...] = ()
        """Ranges of events, in order, whose fixes are predicted and compared but teach nothing."""

    def make_output(self, with_states: bool, with_sigmas: bool = True) -> Output:
        """Room for what a pass leaves."""
        h, f = self.events.yaw_rad.size, self.events.fix_east_m.size
        m = self.timeline.out_t_s.size if with_states else 0
        nan = np.full
        return Output(
            state=np.zeros((m, REPORTED_STATES)),
            sigma=np.zeros((m if with_sigmas else 0, REPORTED_STATES)),
            heading_nu=nan(h, np.nan),
            heading_var=nan(h, np.nan),
            heading_ok=np.zeros(h, dtype=np.bool_),
            fix_nu=nan((f, 2), np.nan),
            fix_var=nan((f, 3), np.nan),
            fix_ok=np.zeros(f, dtype=np.bool_),
            antenna=nan((f, 2), np.nan),
            total=np.zeros(2),
        )

    def begin(self, start: Start, constants: Constants, prior: Floats, values: Floats) -> None:
        """Set state and covariance at the first event.

        prior is the covariance of R_r, R_l, L and the effects' parameters (3 + m, 3 + m), values these parameters (m,).
        """
        options = self.options
        offset = start.offset_rad if options.with_offset else 0.0
        x = np.zeros(BASE_STATES)
        x[: THETA + 1] = start.east_m, start.north_m, start.yaw_rad + start.offset_rad - offset
        x[CONSTANTS] = constants.as_array()
        x[OFFSET] = offset
        variance = np.zeros(self.states)
        variance[: Y + 1] = start.sigma_position_m**2
        variance[THETA] = start.sigma_yaw_rad**2
        variance[OFFSET] = options.offset_prior_rad**2 if options.with_offset else 0.0
        variance[HEADING_BIAS] = self.model.heading_coloured_var
        variance[EAST_BIAS : NORTH_BIAS + 1] = self.model.fix_coloured_var
        covariance = np.diag(variance)
        learnt = np.r_[CONSTANTS, BASE_STATES : self.states]
        covariance[np.ix_(learnt, learnt)] = prior
        self.belief = self.belief._replace(x=x, p=values.copy()).begun(covariance)
        self.memory[:] = 0.0
        self.memory[: MEM_FIX_T + 1] = self.events.t_s[0]
        self.output.total[:] = 0.0
        self.position = 0

    def run_to(self, last: int | None = None) -> None:
        """Run on to (not including) event ``last``; to the end if None."""
        last = self.events.t_s.size if last is None else last
        for first_blind, last_blind in self.blind:
            self._advance(min(first_blind, last), fixes_teach=True)
            self._advance(min(last_blind, last), fixes_teach=False)
        self._advance(last, fixes_teach=True)

    def _advance(self, last: int, fixes_teach: bool) -> None:
        if last > self.position:
            kernel.forward(
                self.events,
                self.columns,
                self.model,
                self.belief,
                self.memory,
                self.position,
                last,
                fixes_teach,
                self.output,
            )
            self.position = last

    def outage_to(self, last: int, scratch: Output) -> None:
        """From here to event ``last`` as if there were no fixes, on copies: this filter stays where it is.

        Fills scratch.antenna with the predicted antenna at the withheld fixes.
        """
        kernel.forward(
            self.events,
            self.columns,
            self.model,
            self.belief.copied(),
            self.memory.copy(),
            self.position,
            last,
            False,
            scratch,
        )

    def finish(self) -> ForwardPass:
        """Run to the end and hand over what was found."""
        self.run_to()
        out = self.output
        return ForwardPass(
            timeline=self.timeline,
            state=out.state,
            sigma=out.sigma,
            final_state=np.concatenate((self.belief.x, self.belief.p)),
            final_covariance=self.belief.covariance(),
            heading_nu_rad=out.heading_nu,
            heading_var_rad2=out.heading_var,
            heading_accepted=out.heading_ok,
            fix_nu_m=out.fix_nu,
            fix_var_m2=out.fix_var,
            fix_accepted=out.fix_ok,
            recoveries=int(self.memory[MEM_RECOVERIES]),
            nll_heading=float(out.total[0]),
            nll_fix=float(out.total[1]),
        )


def prior_covariance(centre: Constants, options: FilterOptions) -> Floats:
    """Prior covariance of R_r, R_l, L (3, 3), m²: common and differential error of the radii, and the track's."""
    radius_m = 0.5 * (centre.radius_right_m + centre.radius_left_m)
    radius2 = (options.radius_prior * radius_m) ** 2
    difference2 = (options.radius_difference_prior * radius_m) ** 2
    shared = radius2 - 0.5 * min(difference2, 2.0 * radius2)
    track2 = (options.track_prior * centre.track_m) ** 2
    return np.array([[radius2, shared, 0.0], [shared, radius2, 0.0], [0.0, 0.0, track2]])


def numeric_limits(centre: Constants) -> tuple[Floats, Floats]:
    """Where the numbers for R_r, R_l, L are held for safety: far beyond every prior, and never near zero."""
    middle = centre.as_array()
    return middle / NUMERIC_RANGE, middle * NUMERIC_RANGE


def make_model(centre: Constants, options: FilterOptions, noise: Noise, linear_at: Constants | None = None) -> Model:
    """The kernel's numbers; without ``linear_at``, derivatives are taken at the running estimate."""
    walk = np.zeros(BASE_STATES)
    walk[RADIUS_RIGHT : RADIUS_LEFT + 1] = (options.radius_walk * centre.radius_right_m) ** 2
    walk[TRACK] = (options.track_walk * centre.track_m) ** 2
    walk[OFFSET] = options.offset_walk_rad**2 if options.with_offset else 0.0
    lower, upper = numeric_limits(centre)
    outside = math.erfc(options.gate_sigmas / math.sqrt(2.0))
    return Model(
        slip2=noise.slip_m_per_sqrt_m**2,
        heading_coloured_var=noise.heading_coloured_rad**2 if options.with_offset else 0.0,
        heading_tau_s=noise.heading_tau_s,
        fix_coloured_var=noise.fix_coloured_m**2,
        fix_tau_s=noise.fix_tau_s,
        walk=walk,
        linear=np.zeros(3) if linear_at is None else linear_at.as_array(),
        lower=lower,
        upper=upper,
        heading_gate=options.gate_sigmas**2,
        fix_gate=-2.0 * math.log(max(outside, 1e-300)),
        soft_gate=options.soft_gate,
        recover_count=float(options.recover_count),
        recover_s=options.recover_s,
        use_offset=options.with_offset,
    )


def make_events(aligned: Aligned, timeline: Timeline, noise: Noise, clear: tuple[Floats, Floats]) -> Events:
    """The kernel's arrays, with the noise's white levels put in; clear as from sccal.align.clear_steps."""
    heading, fix = timeline.heading_index, timeline.fix_index
    if aligned.yaw_sigma_rad is None:
        yaw_var = np.full(heading.size, noise.heading_white_rad**2)
    else:
        relative = aligned.yaw_sigma_rad[heading] / np.median(aligned.yaw_sigma_rad)
        yaw_var = (noise.heading_white_rad * np.clip(relative, 0.1, 100.0)) ** 2
    floor_east_m, floor_north_m = aligned.fix_floor_m
    scale2 = np.full(fix.size, noise.fix_scale**2)
    for code, factor in noise.other_fix_scale.items():
        scale2[aligned.fix_quality[fix] == code] = factor**2
    return Events(
        t_s=timeline.t_s,
        right_rad=timeline.right_rad,
        left_rad=timeline.left_rad,
        right_clear_rad=clear[0],
        left_clear_rad=clear[1],
        loose_m2=timeline.loose_m2,
        heading_row=timeline.heading_row,
        fix_row=timeline.fix_row,
        out_row=timeline.out_row,
        yaw_rad=aligned.yaw_rad[heading],
        yaw_var_rad2=yaw_var,
        fix_east_m=aligned.fix_east_m[fix],
        fix_north_m=aligned.fix_north_m[fix],
        # No level takes away what the digits of the coordinates leave.
        fix_var_east_m2=np.maximum(aligned.fix_var_east_m2[fix] * scale2, floor_east_m**2),
        fix_var_north_m2=np.maximum(aligned.fix_var_north_m2[fix] * scale2, floor_north_m**2),
        fix_cov_m2=aligned.fix_cov_m2[fix] * scale2,
    )
