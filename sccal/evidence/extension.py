"""Effects as further parameters of the filter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from sccal.align import Aligned, Timeline
from sccal.arrays import Floats
from sccal.effects.catalogue import CATALOGUE, effect_named
from sccal.effects.effect import STAGES, Column, Effect, Parameter
from sccal.effects.logged import logged_effects
from sccal.effects.view import Belief, DriveView, view_drive, with_travel
from sccal.errors import DataError, UsageError
from sccal.filter.columns import MOTION_PORTS, HeadingBend, Placed, kernel_columns
from sccal.filter.iterate import LEAST_PATH, At, RunProblem
from sccal.filter.layout import Columns

SMALL_RAD, SMALL_S = 1e-3, 1e-3
SMALL_SHARE = 1e-3
"""Steps of the derivatives by the heading, and by a parameter as a share of its prior."""


@dataclass(frozen=True)
class Free:
    """One effect whose parameters the filter estimates, its shapes (a place, a time) as found by a search."""

    effect: Effect
    shapes: Mapping[str, float] = field(default_factory=dict)
    prior_scale: float = 1.0
    """Factor on the priors: below one for an effect that is in the model only because every log has a little of it."""

    @cached_property
    def key(self) -> str:
        """The effect's name, with its shapes where it has any: "hard_iron(tau_s=8)"."""
        if not self.shapes:
            return self.effect.name
        return f"{self.effect.name}({', '.join(f'{name}={value:.6g}' for name, value in self.shapes.items())})"

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Those that are estimated."""
        return tuple(one for one in self.effect.parameters if not one.shape)

    def placed(self, view: DriveView, values: Sequence[float], first: int) -> list[Placed]:
        """Its columns made at the values of its parameters, numbered from ``first``."""
        number = {one.name: first + k for k, one in enumerate(self.parameters)}
        return [Placed(number[column.parameter], column) for column in self.effect.columns(view, self.at(values))]

    def at(self, values: Sequence[float]) -> dict[str, float]:
        """All its parameters, shapes too, by name."""
        return {**{one.name: float(value) for one, value in zip(self.parameters, values, strict=True)}, **self.shapes}

    def delay_s(self, view: DriveView, values: Sequence[float]) -> Floats | None:
        """How old the effect makes the fixes (f,); None for an effect that has nothing to do with it."""
        return self.effect.fix_delay_s(view, self.at(values))

    def turns(self, view: DriveView, values: Floats) -> Floats:
        """What the effect adds to the heading readings (h,) at some values of its parameters, rad."""
        added = np.zeros(view.headings.t_s.size)
        for one in self.placed(view, values.tolist(), 0):
            column = one.column
            if column.port == "heading":
                added = added + values[one.parameter] * column.values
        return added


@dataclass(frozen=True)
class Laid:
    """Some effects laid out in a drive at some values of their parameters."""

    view: DriveView
    turned_rad: Floats | None
    """How far the robot turned while each fix became old (f,); None where no fix is."""
    count: int = 0
    """Of effects."""
    placed: tuple[Placed, ...] = ()
    known_rad: Floats | float = 0.0
    """Of the heading's readings (h,), beside the columns."""
    slope: Floats | float = 0.0
    one_by_one: Laid | None = None
    """The same before what the effects do to each other: where further ones begin."""

    def and_one(self, free: Free, values: Floats, first: int) -> Laid:
        """With one more effect, its parameters (k,) numbered from ``first``."""
        placed = free.placed(self.view, values.tolist(), first)
        if self.turned_rad is not None and free.delay_s(self.view, values.tolist()) is None:
            placed = _turned_back(placed, self.turned_rad)
        if not free.effect.bends_heading or not values.any():
            together = (*self.placed, *placed)
            return Laid(self.view, self.turned_rad, self.count + 1, together, self.known_rad, self.slope)
        seen = self.view.headings
        turned = replace(self.view, headings=replace(seen, yaw_rad=seen.yaw_rad + SMALL_RAD))
        does = free.turns(self.view, values)
        slope = (free.turns(turned, values) - does) / SMALL_RAD
        here = [one for one in placed if one.column.port != "heading"]
        known = does
        for k, parameter in enumerate(free.parameters):
            step = np.zeros(values.size)
            step[k] = SMALL_SHARE * parameter.prior_sigma
            change = free.turns(self.view, values + step) - free.turns(self.view, values - step)
            here.append(Placed(first + k, Column(parameter.name, "heading", change / (2.0 * step[k]))))
            known = known - values[k] * here[-1].column.values
        return Laid(
            self.view,
            self.turned_rad,
            self.count + 1,
            (*self.placed, *here),
            self.known_rad + known,
            self.slope + slope,
        )

    def columns(self, timeline: Timeline) -> Columns:
        """As the kernel takes them."""
        if not isinstance(self.known_rad, np.ndarray) or not isinstance(self.slope, np.ndarray):
            return kernel_columns(self.placed, timeline)
        return kernel_columns(
            self.placed, timeline, HeadingBend(self.known_rad, self.slope, self.view.headings.yaw_rad)
        )


@dataclass(frozen=True)
class FreeEffects:
    """Some effects, their parameters free, in the order given: those of the vehicle before those of one run alone."""

    effects: tuple[Free, ...]

    @classmethod
    def named(cls, names: Sequence[str], aligned: Aligned | None = None) -> FreeEffects | None:
        """By name; None for no names. A further column of the log is named by port and column: heading~motor_current_a.

        Raises UsageError for unknown ones, and for those that need a search; DataError where the log lacks the column.
        """
        asked = [effect_by_name(name, aligned) for name in names]
        beside = [effect_by_name(effect.beside, aligned) for effect in asked if effect.beside]
        effects = tuple(_as_named(effect) for effect in {one.name: one for one in (*asked, *beside)}.values())
        return cls(effects) if effects else None

    @property
    def parameters(self) -> tuple[tuple[Effect, Parameter], ...]:
        """Every free parameter with its effect, as the filter holds them."""
        return tuple((free.effect, parameter) for free in self.effects for parameter in free.parameters)

    @cached_property
    def prior_sigmas(self) -> Floats:
        """(m,) about zero, in file units."""
        return np.array([free.prior_scale * one.prior_sigma for free in self.effects for one in free.parameters])

    @cached_property
    def antenna(self) -> tuple[int, int] | None:
        """Which parameters are where the antenna stands, forward and left; None where none are."""
        return next(((first, first + 1) for free, first, _ in self._spans if free.effect.is_antenna), None)

    def columns(self, problem: RunProblem, at: At, clear: tuple[Floats, Floats]) -> Columns:
        """The kernel's columns, linearised at the given values along the given path."""
        return self.columns_in(view_run(problem, at, clear), at.values, problem.timeline)

    def columns_in(self, view: DriveView, values: Floats, timeline: Timeline, known: Laid | None = None) -> Columns:
        """The same for a drive that is seen already.

        ``known`` are the first of these effects, laid out in the same view at the same values.
        """
        return self.laid(view, values, known).columns(timeline)

    def laid(self, view: DriveView, values: Floats, known: Laid | None = None) -> Laid:
        """All effects laid out at some values (m,); where fixes are old, arms turn with the robot meanwhile.

        Columns at the heading are derivatives at the values, beside what makes the whole exact there. With D(p, ψ) what
        an effect does to the reading, and c = ∂D/∂p: D(p₀, ψ₀) − c p₀ is known, and ∂D/∂ψ is how much more than by
        itself the reading turns with the robot. Secants, which the effects give, are D over p. Effects of a later
        stage are laid out in the drive that those of the earlier ones leave.
        """
        seen = self._delayed(view, values)
        found = Laid(seen, _turned_rad(seen))
        same_age = known is not None and seen.heading_delay_s == known.view.heading_delay_s
        if known is not None and same_age and found.turned_rad is known.turned_rad is None:
            found = replace(known.one_by_one or known, view=seen)
        new = self._spans[found.count :]
        for number, stage in enumerate(STAGES):
            here = [one for one in new if one[0].effect.stage == stage]
            if here and number:
                before = [one for one in found.placed if self._stages[one.parameter] < number]
                found = replace(found, view=_after(seen, before, values))
            for free, first, last in here:
                found = found.and_one(free, values[first:last], first)
        return replace(self._seen_through(self._with_older(found, values), values), view=seen, one_by_one=found)

    def _seen_through(self, found: Laid, values: Floats) -> Laid:
        """With what further turning does to the readings through effects that show the robot as it turned before.

        A wheel that wobbles at every turn is hardly seen by an AHRS that smooths: whoever expects to see it there finds
        one that is not.
        """
        turns = {
            "right_wheel": 1.0 / found.view.steps.track_m,
            "left_wheel": -1.0 / found.view.steps.track_m,
            "turn": 1.0,
        }
        moving = [one for one in found.placed if one.column.port in turns]
        through = [(free, first, last) for free, first, last in self._spans if values[first:last].any()]
        if not moving or not through:
            return found
        turned = np.column_stack([turns[one.column.port] * one.column.values for one in moving])
        shown = [
            seen
            for free, first, last in through
            if (seen := free.effect.shown_turning(found.view, free.at(values[first:last].tolist()), turned)) is not None
        ]
        if not shown:
            return found
        added = np.sum(shown, axis=0)
        more = tuple(
            Placed(one.parameter, Column("", "heading", column)) for one, column in zip(moving, added.T, strict=True)
        )
        known = found.known_rad - added @ values[[one.parameter for one in moving]]
        return replace(found, placed=(*found.placed, *more), known_rad=known)

    def _with_older(self, found: Laid, values: Floats) -> Laid:
        """The derivative by the readings' age, with what the other effects do there: they too are shown as they were.

        Without it a fit of a latency beside a smoothing crawls: each round leaves half of the way.
        """
        late = [first for free, first, _ in self._spans if free.effect.undone_for == "headings"]
        if not late or not any(one.effect.bends_heading for one, first, _ in self._spans if first != late[0]):
            return found
        older = replace(found.view, heading_delay_s=found.view.heading_delay_s + SMALL_S)
        slope = np.zeros(found.view.headings.t_s.size)
        for free, first, last in self._spans:
            if first != late[0] and free.effect.bends_heading and values[first:last].any():
                more = free.turns(older, values[first:last]) - free.turns(found.view, values[first:last])
                slope = slope + more / SMALL_S
        if not slope.any():
            return found
        placed = tuple(
            replace(one, column=replace(one.column, values=one.column.values + slope))
            if one.parameter == late[0] and isinstance(one.column, Column)
            else one
            for one in found.placed
        )
        return replace(found, placed=placed, known_rad=found.known_rad - values[late[0]] * slope)

    @cached_property
    def _spans(self) -> tuple[tuple[Free, int, int], ...]:
        """Each effect with where its parameters begin and end among all."""
        ends = np.cumsum([0, *(len(free.parameters) for free in self.effects)]).tolist()
        return tuple((free, first, last) for free, (first, last) in zip(self.effects, pairwise(ends), strict=True))

    @cached_property
    def _delaying(self) -> tuple[tuple[Free, int, int], ...]:
        """Those that make fixes or readings older than their stamps."""
        plain = (Effect.fix_delay_s, Effect.heading_delay_s)
        return tuple(
            one
            for one in self._spans
            if (type(one[0].effect).fix_delay_s, type(one[0].effect).heading_delay_s) != plain
        )

    @cached_property
    def _stages(self) -> list[int]:
        """Of each parameter's effect, by number."""
        return [STAGES.index(effect.stage) for effect, _ in self.parameters]

    def _delayed(self, view: DriveView, values: Floats) -> DriveView:
        """The drive with how old fixes and readings are at some values (f,)."""
        fixes_s, headings_s = np.zeros(view.fixes.t_s.size), 0.0
        for free, first, last in self._delaying:
            at = free.at(values[first:last].tolist())
            delay_s = free.effect.fix_delay_s(view, at)
            fixes_s = fixes_s if delay_s is None else fixes_s + delay_s
            headings_s += free.effect.heading_delay_s(at)
        if not fixes_s.any() and not headings_s:
            return view
        return replace(view, fix_delay_s=fixes_s if fixes_s.any() else 0.0, heading_delay_s=headings_s)


def _after(view: DriveView, placed: Sequence[Placed], values: Floats) -> DriveView:
    """The drive with what some columns, scaled by parameters (m,), add to the wheels' travel or take from it."""
    right_m, left_m = view.steps.right_m, view.steps.left_m
    moves = [one for one in placed if one.column.port in MOTION_PORTS and values[one.parameter] != 0.0]
    for one in moves:
        more, port = values[one.parameter] * one.column.values, one.column.port
        if port == "turn":
            aside_m = 0.5 * view.steps.track_m * more
            right_m, left_m = right_m + aside_m, left_m - aside_m
        if port in ("right_wheel", "along"):
            right_m = right_m + more
        if port in ("left_wheel", "along"):
            left_m = left_m + more
    return with_travel(view, right_m, left_m) if moves else view


def _turned_rad(view: DriveView) -> Floats | None:
    """How far the robot turned between what each fix shows and its stamp (f,); None where no fix is old."""
    if not isinstance(view.fix_delay_s, np.ndarray):
        return None
    so_far, t_s = np.cumsum(view.steps.turn_rad), view.fixes.t_s
    now, then = (np.interp(each, view.steps.t_s, so_far) for each in (t_s, t_s - view.fix_delay_s))
    return np.asarray(now - then)


def _turned_back(placed: Sequence[Placed], turned_rad: Floats) -> list[Placed]:
    """Columns at the antenna as the robot stood before it turned by so much (f,)."""
    found: list[Placed] = []
    c, s = np.cos(turned_rad), np.sin(turned_rad)
    for one in placed:
        column = one.column
        if column.port not in ("antenna_forward", "antenna_left"):
            found.append(one)
            continue
        # Rot(−α) (f, l) = (f cos α + l sin α, −f sin α + l cos α)
        forward, left = (c, -s) if column.port == "antenna_forward" else (s, c)
        found.append(Placed(one.parameter, Column("", "antenna_forward", forward * column.values)))
        found.append(Placed(one.parameter, Column("", "antenna_left", left * column.values)))
    return found


def view_run(problem: RunProblem, at: At, clear: tuple[Floats, Floats] | None) -> DriveView:
    """The drive as columns see it, along the given path."""
    return view_drive(problem.aligned, problem.timeline, _belief(problem, at), clear)


def name_in(key: str) -> str:
    """The effect's name in a key of Free."""
    return key.partition("(")[0]


def plain_form(effect: Effect) -> Free | None:
    """An effect where its shapes have their usual values; None where they have none and must be searched for."""
    shapes = [one for one in effect.parameters if one.shape]
    if any(one.default is None for one in shapes):
        return None
    return Free(effect, {one.name: float(one.default) for one in shapes if one.default is not None})


def plain_forms() -> list[Free]:
    """The catalogue's effects that need no search."""
    return [free for effect in CATALOGUE.values() if (free := plain_form(effect)) is not None]


def _as_named(effect: Effect) -> Free:
    """An effect with its shapes where they usually are. Raises UsageError where a shape has to be searched for."""
    free = plain_form(effect)
    if free is None:
        lacking = [one.name for one in effect.parameters if one.shape and one.default is None]
        raise UsageError(
            f"effect {effect.name}: its {', '.join(lacking)} must be searched for, not filtered: `sccal diagnose` does"
        )
    return free


def effect_by_name(name: str, aligned: Aligned | None) -> Effect:
    """An effect of the catalogue, or of a column of the run.

    Raises:
        UsageError: no effect has that name.
        DataError: the log lacks the column.
    """
    if "~" not in name:
        return effect_named(name)
    logged = {one.name: one for one in logged_effects([aligned.extras] if aligned else [])}
    if name not in logged:
        raise DataError(
            f"effect {name!r}: this log has no such further column that varies; "
            + (f"there are {', '.join(logged)}" if logged else "it has none at all")
        )
    return logged[name]


def _belief(problem: RunProblem, at: At) -> Belief:
    """The path of an earlier pass, or the wheels laid out along the AHRS yaw from where the run starts."""
    constants, start = at.constants, problem.start
    if at.path is not None:
        state = at.path.state
        t_s, east, north, yaw = at.path.timeline.out_t_s, state[:, 0], state[:, 1], state[:, 2]
    if at.path is None or t_s.size < LEAST_PATH:
        aligned = problem.aligned
        turned = start.wheel_scale * np.exp(-1j * start.offset_rad) * aligned.path_along_yaw
        t_s = aligned.wheel_t_s
        east, north = start.east_m + turned.real, start.north_m + turned.imag
        yaw = np.interp(t_s, aligned.heading_t_s, aligned.yaw_rad) - start.offset_rad
    return Belief(constants.radius_right_m, constants.radius_left_m, constants.track_m, t_s, yaw, east, north)
