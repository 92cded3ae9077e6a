"""What is true of a case, and which endings of a command a field engineer would accept."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from studies.arrays import Effects
from studies.field.world import Log

True_ = float | tuple[float, float] | list[float]
"""A value; a span in which any value is right (a tuple); or several values, of which any is right (a list)."""


@dataclass(frozen=True)
class Truth:
    """What is true of a log."""

    readings: tuple[Mapping[str, True_], ...]
    """Constants by name. Where the log means the same under two readings, each is one; any may be told, whole."""
    effects: Effects = field(default_factory=dict)
    """Effects of the robot that sccal has a name for, with those of their parameters that are known."""

    @staticmethod
    def of(log: Log, effects: Effects | None = None, **changed: True_) -> Truth:
        """The constants of a log, some of them changed or (by a span without limits) unknown."""
        return Truth(({**log.constants, **changed},), effects or {})


ANY: tuple[float, float] = (float("-inf"), float("inf"))
"""A value that cannot be told from the log, or has no single truth."""

SIGMAS: Mapping[str, float] = {
    "radius_right_m": 0.0022,
    "radius_left_m": 0.0022,
    "track_m": 0.0045,
    "heading_offset_deg": 0.55,
}
"""Sigmas that are expected of a clear log, at most: shares of radii and track, degrees. About three times what a clean
drive of three minutes gives."""


@dataclass(frozen=True)
class Way:
    """One acceptable ending of `calibrate`."""

    name: str
    exits: tuple[int, ...] = (0,)
    levels: tuple[str, ...] = ()
    """First words of the verdict; none: any."""
    says: tuple[str, ...] = ()
    """Patterns that must be found, in any case of letters, in all that was printed."""
    estimated: tuple[str, ...] = ()
    """Constants that must be estimated, within four sigmas."""
    wider: float = 1.0
    """By how much their sigmas may be wider than what a clear log gives."""
    runs: int | None = None
    """The number of runs that must be found."""


def right(
    wider: float = 1.0,
    levels: tuple[str, ...] = ("good",),
    says: tuple[str, ...] = (),
    without: tuple[str, ...] = (),
    runs: int | None = None,
) -> Way:
    """The right constants with useful sigmas."""
    kept = tuple(name for name in SIGMAS if name not in without)
    return Way("right", (0,), levels, says, kept, wider, runs)


def doubted(*says: str) -> Way:
    """No good verdict, and the matter is named."""
    return Way("doubt", (0,), ("doubtful", "partial", "unusable"), says)


def refused(*says: str) -> Way:
    """No result, and the message names the matter."""
    return Way("refusal", (3,), (), says)


def honest(*says: str) -> Way:
    """Any verdict, as long as nothing that is called estimated is wrong."""
    return Way("honest", (0,), (), says)


ANY_LEVEL = ("good", "partial", "doubtful")
NOT_GOOD = ("partial", "doubtful", "unusable")


@dataclass(frozen=True)
class Diagnosis:
    """What `diagnose` ought to say."""

    names: tuple[str, ...] = ()
    """Effects of which one must be a finding, or an alias of one."""
    nothing: bool = False
    """No finding at all."""
    not_named: tuple[str, ...] = ()
    """Effects that must not be findings."""
    says: tuple[str, ...] = ()
    never: tuple[str, ...] = ()
    or_says: tuple[str, ...] = ()
    """Patterns that do as well as the names."""


@dataclass(frozen=True)
class Asked:
    """Another command on the same log or on its result, `RUN` and `OUT` standing for the two."""

    command: tuple[str, ...]
    exits: tuple[int, ...] = (0,)
    says: tuple[str, ...] = ()
    never: tuple[str, ...] = ()


def inspected(*says: str, never: tuple[str, ...] = (), exits: tuple[int, ...] = (0,)) -> Asked:
    """What `inspect` ought to show."""
    return Asked(("inspect", "RUN"), exits, says, never)


def exported(form: str, *says: str, never: tuple[str, ...] = ()) -> Asked:
    """What `export` ought to say of the calibration."""
    return Asked(("export", form, "OUT"), (0,), says, never)


Build = Callable[[Path], Truth]


@dataclass(frozen=True)
class FieldCase:
    """A situation: how to write it, and how it ought to end."""

    name: str
    part: str
    """`known` or `further`."""
    kind: str
    build: Build
    ways: tuple[Way, ...]
    never: tuple[str, ...] = ()
    """Patterns that no command may print."""
    diagnosis: Diagnosis | None = None
    asked: tuple[Asked, ...] = ()
    options: tuple[str, ...] = ()
    """Options of every command, such as topics."""

    def __str__(self) -> str:
        return self.name


@dataclass
class Chapter:
    """Cases of one kind, gathered as they are defined."""

    part: str
    kind: str
    cases: list[FieldCase] = field(default_factory=list)

    def case(
        self,
        name: str,
        *ways: Way,
        never: tuple[str, ...] = (),
        diagnosis: Diagnosis | None = None,
        asked: tuple[Asked, ...] = (),
        options: tuple[str, ...] = (),
    ) -> Callable[[Build], Build]:
        """Keep a building function as a case; the ways are what may come of it."""

        def keep(build: Build) -> Build:
            self.add(name, build, *ways, never=never, diagnosis=diagnosis, asked=asked, options=options)
            return build

        return keep

    def add(
        self,
        name: str,
        build: Build,
        *ways: Way,
        never: tuple[str, ...] = (),
        diagnosis: Diagnosis | None = None,
        asked: tuple[Asked, ...] = (),
        options: tuple[str, ...] = (),
    ) -> None:
        """The same for functions that are made on the way."""
        self.cases.append(FieldCase(name, self.part, self.kind, build, ways, never, diagnosis, asked, options))
