"""The constants as the maximum of the posterior: passes that start and linearise at their own answer.

A forward pass linearises at whatever it believes on the way. For the final values the pass is repeated with start and
derivatives *at* the estimate, and the prior carried as what it is: a Gauss-Newton iteration whose fixed point is the
posterior mode (as in the iterated Kalman filter, Bell and Cathey 1993).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from sccal.align import Aligned, Timeline, clear_steps
from sccal.arrays import Floats
from sccal.errors import DataError
from sccal.filter.columns import kernel_columns
from sccal.filter.forward import Filter, ForwardPass, numeric_limits, prior_covariance
from sccal.filter.layout import (
    BASE_STATES,
    PORT_ANTENNA_FORWARD,
    PORT_ANTENNA_LEFT,
    PORT_EAST,
    PORT_NORTH,
    THETA,
    WITH_OFFSET,
    Columns,
)
from sccal.filter.options import FilterOptions
from sccal.filter.start import Constants, Start, find_start, first_constants
from sccal.results.noise import Noise

MAX_ROUNDS = 6
CLOSE_SIGMAS = 0.05
WORSE_NATS, MOST_HALVINGS = 3.0, 5
"""A step after which the data are less likely by more than what linearising elsewhere changes is halved, so often."""
NARROW = 0.1
"""Of the effects' priors: so narrow they are where a pass with the whole ones would leave the path."""
ANTENNA_M = 1.0
"""How far the place may be from the first fixes, for all that a fit knows: with a start that is sure of it, an antenna
off the middle stays near where it was supposed to be. The same with an antenna and without, so that fits compare."""
KNOWN_AFTER = 100.0
STOOD_S = 5.0
LEAST_PATH = 10
"""Output times of a pass below which it does not show the path: the noise search keeps almost none."""
TURNS_THE_START_RAD = np.radians(1.0)
"""Effects that turn the heading by less while the robot sets off are within the start's own sigma."""


@dataclass(frozen=True)
class At:
    """Where a pass starts and linearises."""

    constants: Constants
    values: Floats
    """Of the extension's parameters (m,)."""
    path: ForwardPass | None = None
    """An earlier pass, for what depends on where the robot was; None: the wheels along the AHRS yaw."""

    @property
    def prior_scale(self) -> float:
        """Of the effects' priors within a pass from here: that of the earlier one."""
        return 1.0 if self.path is None else self.path.prior_scale


@dataclass(frozen=True)
class LaidOut:
    """What a pass needs that follows from where it linearises, whatever the noise."""

    clear: tuple[Floats, Floats]
    """The wheels' motion freed of slip."""
    columns: Columns
    start: Start


class Extension(Protocol):
    """Parameters beyond the paper's, supplied by a room that knows effects; the filter knows columns only."""

    @property
    def prior_sigmas(self) -> Floats:
        """(m,) about zero."""
        ...

    @property
    def antenna(self) -> tuple[int, int] | None:
        """Which parameters are where the antenna stands, forward and left; None where none are."""
        ...

    def columns(self, problem: RunProblem, at: At, clear: tuple[Floats, Floats]) -> Columns:
        """The kernel's columns for the problem's timeline; clear as from RunProblem.clear_steps."""
        ...


@dataclass(frozen=True)
class RunProblem:
    """One run prepared for filtering: what passes over it need, wherever they start from."""

    aligned: Aligned
    timeline: Timeline
    start: Start
    noise: Noise
    options: FilterOptions
    extension: Extension | None = None

    @cached_property
    def centre(self) -> Constants:
        """The middle of the constants' priors."""
        return first_constants(self.aligned, self.start)

    @cached_property
    def prior_mean(self) -> Floats:
        """(3 + m,) R_r, R_l, L and the extension's parameters."""
        return np.concatenate((self.centre.as_array(), np.zeros(self.extra)))

    @cached_property
    def prior(self) -> Floats:
        """Covariance of the same (3 + m, 3 + m)."""
        covariance = np.zeros((3 + self.extra, 3 + self.extra))
        covariance[:3, :3] = prior_covariance(self.centre, self.options)
        if self.extension is not None:
            covariance[3:, 3:] = np.diag(self.extension.prior_sigmas**2)
        return covariance

    @property
    def extra(self) -> int:
        """Number of parameters beyond the paper's."""
        return 0 if self.extension is None else self.extension.prior_sigmas.size

    def scaled_prior(self, scale: float) -> Floats:
        """The prior (3 + m, 3 + m) with the effects' sigmas multiplied."""
        if scale == 1.0:
            return self.prior
        factor = np.ones(3 + self.extra)
        factor[3:] = scale
        return np.asarray(self.prior * np.outer(factor, factor))

    def at_centre(self, constants: Constants | None = None) -> At:
        """The extension's parameters at zero."""
        return At(self.centre if constants is None else constants, np.zeros(self.extra))

    def at_first(self, constants: Constants | None = None) -> At:
        """The same, but the antenna where the path shows it roughly: where a fit begins that knows nothing yet."""
        return self.with_antenna(self.at_centre(constants))

    def with_antenna(self, at: At) -> At:
        """The same place, the antenna where the path shows it roughly, without an earlier pass that knew of none."""
        places = None if self.extension is None else self.extension.antenna
        roughly_m = self.aligned.antenna_m
        if places is None or roughly_m is None:
            return at
        values = at.values.copy()
        values[list(places)] = roughly_m
        return At(at.constants, values)

    def clear_steps(self, constants: Constants) -> tuple[Floats, Floats]:
        """The wheels' motion freed of slip, given the ratio of the radii."""
        return clear_steps(self.aligned, self.timeline, constants.radius_right_m / constants.radius_left_m)

    def columns(self, at: At, clear: tuple[Floats, Floats]) -> Columns:
        """The extension's columns, or none."""
        return kernel_columns((), self.timeline) if self.extension is None else self.extension.columns(self, at, clear)

    def start_given(self, columns: Columns, values: Floats) -> Start:
        """Where the run begins if the effects hold: iron turns the first heading, and an antenna off the middle moves
        the first place.
        """
        return _below_the_antenna(self._unbent_start(columns, values), columns, values)

    def _unbent_start(self, columns: Columns, values: Floats) -> Start:
        if not columns.heading_param.size:
            return self.start
        added = columns.heading @ values[columns.heading_param] + columns.heading_known
        t_s = self.aligned.heading_t_s[self.timeline.heading_index]
        first = added[: max(int(np.searchsorted(t_s, self.start.until_s)), 1)]
        if np.ptp(first) < TURNS_THE_START_RAD:
            return self.start
        yaw = self.aligned.yaw_rad - np.interp(self.aligned.heading_t_s, t_s, added)
        try:
            return find_start(replace(self.aligned, yaw_rad=yaw))
        except DataError:  # the effects stand where no robot could be: what was found without them is nearer
            return self.start

    def laid_out(self, at: At, clear: tuple[Floats, Floats] | None = None, columns: Columns | None = None) -> LaidOut:
        """What a pass from there needs, for passes under several noises; what is known of it already may be given."""
        clear = self.clear_steps(at.constants) if clear is None else clear
        columns = self.columns(at, clear) if columns is None else columns
        start = self.start_given(columns, at.values)
        return LaidOut(clear, columns._replace(fix_at=self._antenna_at(at, columns, start)), start)

    def _antenna_at(self, at: At, columns: Columns, start: Start) -> Floats:
        """Heading (f,) about which the antenna turns with the robot before the heading is known, then NaN.

        Turned with an estimate that still moves, every correction of the heading would pass for a turn that shows the
        arm: a robot that stands "finds" it in the noise of the fixes (Huang, Mourikis and Roumeliotis 2010). So it is
        turned with the AHRS until then, and as one while the robot stands first. (0,) where no antenna is off the
        middle.
        """
        if not np.any(columns.fix_port < PORT_EAST):
            return np.zeros(0)
        return self._headings(at, columns, start, self.aligned.fix_t_s[self.timeline.fix_index])

    def _headings(self, at: At, columns: Columns, start: Start, t_s: Floats) -> Floats:
        """The robot's heading by the AHRS at some times (f,), rad, NaN once the filter knows it better."""
        read_s = self.aligned.heading_t_s[self.timeline.heading_index]
        read = self.aligned.yaw_rad[self.timeline.heading_index] - columns.heading_known
        read = read - columns.heading @ at.values[columns.heading_param]
        stood = read_s <= start.moving_from_s
        last = stood & (read_s > start.moving_from_s - STOOD_S)
        if last.any():
            read = np.where(stood, read[last].mean(), read)
        offset = self._offset_where_known(at.path, read_s, read, start.offset_rad)
        return np.where(t_s < self._known_from_s, np.interp(t_s, read_s, read) - offset, np.nan)

    def _offset_where_known(self, path: ForwardPass | None, read_s: Floats, read: Floats, otherwise: float) -> float:
        """How far the readings (h,) are off the heading of an earlier pass as soon as that knows it.

        ``otherwise`` where it does not show the path.
        """
        if path is None or path.timeline.out_t_s.size < LEAST_PATH:
            return otherwise
        out_s, from_s = path.timeline.out_t_s, self._known_from_s
        beside = (out_s >= from_s) & (out_s < from_s + STOOD_S)
        off = np.exp(1j * (np.interp(out_s[beside], read_s, read) - path.state[beside, THETA]))
        return float(np.angle(off.sum())) if beside.any() else otherwise

    @cached_property
    def _known_from_s(self) -> float:
        """When the fixes have shown the heading to a hundredth: a hundred of their sigmas after the robot set off."""
        aligned = self.aligned
        sigma_m = float(np.median(np.sqrt(aligned.fix_var_east_m2)))
        gone = np.abs(aligned.travel_m - np.interp(self.start.moving_from_s, aligned.wheel_t_s, aligned.travel_m))
        far = np.flatnonzero(gone > KNOWN_AFTER * sigma_m)
        first, last = aligned.span_s
        return min(float(aligned.wheel_t_s[far[0]]) if far.size else last, 0.5 * (first + last))

    def begun(
        self,
        at: At,
        linearise_there: bool = False,
        laid: LaidOut | None = None,
        with_sigmas: bool = True,
        prior_scale: float | None = None,
    ) -> Filter:
        """A filter at the first event, its priors around the given values.

        ``laid`` spares its computation where it is known already; without sigmas the outputs hold states alone, which
        spares much where there are many effects.
        """
        laid = self.laid_out(at) if laid is None else laid
        run = Filter(
            self.aligned,
            self.timeline,
            self.noise,
            self.options,
            self.centre,
            laid.clear,
            at.constants if linearise_there else None,
            laid.columns if linearise_there else laid.columns._replace(fix_at=np.zeros(0)),
            self.extra,
            with_sigmas,
        )
        scale = at.prior_scale if prior_scale is None else prior_scale
        start = laid.start
        if linearise_there or self.extra:
            start = replace(start, sigma_position_m=float(np.hypot(start.sigma_position_m, ANTENNA_M)))
        run.begin(start, at.constants, self.scaled_prior(scale), at.values)
        return run

    def passed(
        self, at: At, laid: LaidOut | None = None, with_sigmas: bool = True, prior_scale: float | None = None
    ) -> ForwardPass:
        """A whole pass that starts and linearises there; see ``begun`` for the rest."""
        scale = at.prior_scale if prior_scale is None else prior_scale
        run = self.begun(at, True, laid, with_sigmas, scale)
        return self.with_whole_prior(at, run.finish(), scale)

    def with_whole_prior(self, at: At, found: ForwardPass, scale: float) -> ForwardPass:
        """A finished pass as if the effects' priors within it had not been narrower than they are.

        Narrower ones keep a pass near the path along which it is linear: beside fifty wide ones the first minutes of a
        log could be nearly anything, and a heading that is guessed wrong by half a turn stays wrong. What a prior
        N(x*, s² Λ) about the start has done to a Gaussian posterior N(x* + e, C), the same about Λ undoes exactly:

            C' = C − C (C − Λ s²/(1 − s²))⁻¹ C      e' = e − C (C − Λ s²/(1 − s²))⁻¹ e

        for the effects and with them for all that hangs together with them, and the likelihood changes by
        ½ log(|Λ| |C| / (|s² Λ| |C'|)) + ½ eᵀ C⁻¹ (e − e').
        """
        s = scale
        if s == 1.0 or not self.extra:
            return found
        unit = np.sqrt(np.diag(self.prior))[3:]
        state, covariance = found.final_state.copy(), found.final_covariance
        own = slice(BASE_STATES, state.size)
        inner = covariance[own, own] / np.outer(unit, unit)
        moved = (state[own] - at.values) / unit
        gain = np.linalg.solve(inner - np.eye(self.extra) * s**2 / (1.0 - s**2), covariance[:, own].T / unit[:, None]).T
        state -= gain @ moved
        covariance = covariance - gain @ (covariance[own, :] / unit[:, None])
        covariance = 0.5 * (covariance + covariance.T)
        left = (state[own] - at.values) / unit
        wide = covariance[own, own] / np.outer(unit, unit)
        logs = np.linalg.slogdet(inner)[1] - np.linalg.slogdet(wide)[1] - 2.0 * self.extra * np.log(s)
        shift = 0.5 * float(logs) + 0.5 * float(moved @ np.linalg.solve(inner, moved - left))
        return replace(found, final_state=state, final_covariance=covariance, prior_scale=s, nll_prior=shift)


def _below_the_antenna(start: Start, columns: Columns, values: Floats) -> Start:
    """The place that belongs to the first fixes, as far from them as the effects put these at the first of them."""
    if not columns.fix.size:
        return start
    moved_m = np.zeros(4)
    np.add.at(moved_m, columns.fix_port, columns.fix[0] * values[columns.fix_param])
    turned = complex(*moved_m[[PORT_ANTENNA_FORWARD, PORT_ANTENNA_LEFT]]) * np.exp(1j * start.yaw_rad)
    east_m, north_m = moved_m[PORT_EAST] + turned.real, moved_m[PORT_NORTH] + turned.imag
    return replace(start, east_m=start.east_m - east_m, north_m=start.north_m - north_m)


def iterate(
    problem: RunProblem, first: At, max_rounds: int = MAX_ROUNDS, with_sigmas: bool = True
) -> tuple[Floats, ForwardPass]:
    """Posterior mode of R_r, R_l, L, Ofs and the extension's parameters (4 + m,), and the pass linearised there.

    A pass that starts at x* with prior covariance P0 treats x* as the prior mean. To first order the posterior with
    the true prior mean m0 is then its own mean plus P P0⁻¹ (m0 − x*), P its posterior covariance.
    """
    information = np.linalg.inv(problem.prior)
    lower, upper = numeric_limits(problem.centre)
    learnt = np.r_[0:3, 4 : 4 + problem.extra]
    at = At(Constants.of(np.clip(first.constants.as_array(), lower, upper)), first.values, first.path)
    best: tuple[float, At, ForwardPass, Floats] | None = None
    halvings = 0
    scale = 1.0
    for _ in range(max_rounds + MOST_HALVINGS):
        theta = np.concatenate((at.constants.as_array(), at.values))
        laid = problem.laid_out(at)
        found = problem.passed(at, laid, with_sigmas, scale)
        cost = whole_nll(problem, at, found)
        if best is None and problem.extra:
            narrow = problem.passed(at, laid, with_sigmas, NARROW)
            if (other := whole_nll(problem, at, narrow)) < cost - WORSE_NATS:
                found, cost, scale = narrow, other, NARROW
        if best is not None and not cost < best[0] + WORSE_NATS:
            # The step went too far: half of it, from where the data were likeliest.
            if halvings >= MOST_HALVINGS:
                break
            halvings += 1
            before = np.concatenate((best[1].constants.as_array(), best[1].values))
            theta = 0.5 * (theta + before)
            at = At(Constants.of(theta), theta[3:], best[1].path)
            continue
        covariance = reported_covariance(found)
        mode = reported_values(found) + covariance[:, learnt] @ information @ (problem.prior_mean - theta)
        mode[:3] = np.clip(mode[:3], lower, upper)
        moved = np.abs(mode[learnt] - theta) / np.sqrt(np.maximum(np.diag(covariance)[learnt], 1e-30))
        best = cost, at, found, mode
        max_rounds -= 1
        if moved.max() < CLOSE_SIGMAS or max_rounds <= 0:
            break
        at = At(Constants.of(mode[learnt]), mode[learnt][3:], found if problem.extra else None)
    assert best is not None
    return best[3], best[2]


def likeliest(problem: RunProblem, some: Sequence[At]) -> At:
    """Of some places to start from, that at which the data are likeliest."""
    if len(some) == 1:
        return some[0]
    return min(some, key=lambda at: whole_nll(problem, at, problem.passed(at, with_sigmas=False)))


def whole_nll(problem: RunProblem, at: At, found: ForwardPass) -> float:
    """Negative log-likelihood of a run's measurements, constants and effects marginalised under their own priors.

    ``found`` is a pass that started and linearised at ``at``.
    """
    return found.nll + prior_shift_nats(problem, at, found)


def prior_shift_nats(problem: RunProblem, at: At, found: ForwardPass) -> float:
    """What the negative log-likelihood of a pass lacks because its priors stood around its start, not their own mean.

    A pass that starts at x* has the prior N(x*, P0) and leaves the posterior N(x* + e, P). Under the prior N(m0, P0),
    with d = m0 − x*, the data's likelihood is the posterior mean of the ratio of the two priors:

        shift = ½ dᵀ P0⁻¹ d − ½ dᵀ P0⁻¹ P P0⁻¹ d − dᵀ P0⁻¹ e
    """
    learnt = np.r_[0:3, 4 : 4 + problem.extra]
    theta = np.concatenate((at.constants.as_array(), at.values))
    away = np.linalg.solve(problem.prior, problem.prior_mean - theta)
    covariance = reported_covariance(found)[np.ix_(learnt, learnt)]
    moved = reported_values(found)[learnt] - theta
    return float(0.5 * away @ problem.prior @ away - 0.5 * away @ covariance @ away - away @ moved)


def reported_values(found: ForwardPass) -> Floats:
    """R_r, R_l, L, Ofs and the extension's parameters (4 + m,) after the last event."""
    return np.concatenate((found.final_state[WITH_OFFSET], found.final_state[BASE_STATES:]))


def reported_covariance(found: ForwardPass) -> Floats:
    """Covariance of the same (4 + m, 4 + m)."""
    rows = np.r_[WITH_OFFSET, BASE_STATES : found.final_state.size]
    return np.asarray(found.final_covariance[np.ix_(rows, rows)])
