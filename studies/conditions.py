"""The logs of the effects' study: the robot, drive and instruments of each effect, and whether it shows there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from studies.arrays import stream
from studies.causes import ON_HILLS, OWN_CLOCK, Label, draw_effects
from studies.drives import Plan
from studies.robot import Scenario
from studies.vehicles import FixKind, draw_instruments, draw_noise, draw_robot, with_gaps
from studies.visibility import MINIMUM_NATS, visible_nats

CONDITIONS = ("usual", "gaps", "float", "autonomous", "wandering")
ATTEMPTS = 15
"""So many robots, drives and sizes are drawn until every effect of a case shows."""
DRIVES = ("mixed", "mixed", "mixed", "wander", "rows", "eights", "pivots", "arcs")
MOST_IDLE_COLUMNS = 6


@dataclass(frozen=True)
class Drawn:
    """A scenario with the rough visibility of each of its effects."""

    scenario: Scenario
    nats: dict[str, float]

    @property
    def shows(self) -> bool:
        """Whether every effect can be seen."""
        return min(self.nats.values()) >= MINIMUM_NATS


def draw_visible(seed: int, labels: Sequence[Label], condition: str) -> Drawn:
    """The first of some draws in which every effect shows, or the last draw where none did."""
    for attempt in range(ATTEMPTS):
        scenario = draw_scenario(seed, attempt, labels, condition)
        nats: dict[str, float] = {}
        for label in labels:
            nats[label.name] = visible_nats(scenario, label.name)
            if nats[label.name] < MINIMUM_NATS:
                break
        drawn = Drawn(scenario, nats)
        if drawn.shows:
            return drawn
    return drawn


def draw_scenario(seed: int, attempt: int, labels: Sequence[Label], condition: str) -> Scenario:
    """One draw: a varied drive of 5 to 25 minutes, idle columns, and the effects in sizes that suit the robot."""
    rng = stream(seed, f"effects study {attempt}")
    fix_kind: FixKind = "float" if condition == "float" else "autonomous" if condition == "autonomous" else "rtk"
    shortest_s = 300.0 if fix_kind == "rtk" else 600.0
    plan = Plan(
        kind=str(rng.choice(DRIVES)),
        duration_s=round(float(np.exp(rng.uniform(np.log(shortest_s), np.log(1500.0))))),
        stand_first_s=float(rng.uniform(2.0, 10.0)),
    )
    instruments = draw_instruments(rng, fix_kind)
    if condition == "gaps":
        instruments = with_gaps(instruments, rng, plan.duration_s)
    names = {label.name for label in labels}
    if names & OWN_CLOCK:
        instruments = replace(instruments, fix_format="csv" if rng.random() < 0.5 else "nmea_unix")
    scenario = Scenario(
        seed=seed * 100 + attempt,
        plan=plan,
        robot=draw_robot(rng),
        noise=draw_noise(rng, fix_kind, wandering=condition == "wandering"),
        instruments=instruments,
        idle_columns=int(rng.integers(0, MOST_IDLE_COLUMNS + 1)),
        hills=bool(names & ON_HILLS),
    )
    return replace(scenario, effects=draw_effects(rng, scenario, list(labels)))
