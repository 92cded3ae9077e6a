"""The command line of the studies: `python -m studies noise | effects | parking | field | log`."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from studies import effects, noise, parking
from studies.cases import PoolOptions
from studies.causes import Label
from studies.conditions import CONDITIONS, draw_visible
from studies.field import study as field
from studies.robot import write_log
from studies.tables import publish


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one study, print its tables, and write them and the single cases where a file is asked for."""
    given = _parser().parse_args(arguments)
    if given.study == "log":
        _write_one(given)
        return
    text, data = _run(given)
    publish(text, given.out)
    if given.out is not None:
        given.out.with_suffix(".json").write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


def _run(given: argparse.Namespace) -> tuple[str, dict[str, Any]]:
    """The study that was asked for."""
    if given.study == "field":
        return field.run(given.only, given.part, PoolOptions(given.jobs, given.keep))
    options = PoolOptions(given.jobs, given.keep, tuple(given.only))
    if given.study == "noise":
        return noise.run(given.runs, given.seed, options, not given.calibrate_only)
    if given.study == "parking":
        return parking.run(given.drives, given.seed, options)
    return effects.run(given.seed, given.repeats, 0 if given.singles else given.pairs, options)


def _write_one(given: argparse.Namespace) -> None:
    """One log with some effects, drawn until they show."""
    if given.effects:
        drawn = draw_visible(given.seed, [Label(text) for text in given.effects], given.condition)
        write_log(drawn.scenario, given.folder)
        print(json.dumps({"effects": drawn.scenario.effects, "nats": drawn.nats}, indent=1))
    else:
        write_log(noise.draw_scenario(given.seed), given.folder)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m studies", description="Studies that judge sccal from outside.")
    studies = parser.add_subparsers(dest="study", required=True)
    of_noise = studies.add_parser("noise", help="effect-free logs")
    of_noise.add_argument("--runs", type=int, default=200, help="number of logs (200)")
    of_noise.add_argument("--calibrate-only", action="store_true", help="leave diagnose out")
    of_effects = studies.add_parser("effects", help="every effect alone, and drawn pairs and triples")
    of_effects.add_argument("--singles", action="store_true", help="only the effects alone")
    of_effects.add_argument("--repeats", type=int, default=2, help="logs for each effect alone (2)")
    of_effects.add_argument("--pairs", type=int, default=60, help="number of pairs and triples (60)")
    of_parking = studies.add_parser("parking", help="a robot that parks")
    of_parking.add_argument("--drives", type=int, default=3, help="number of drives, 16 logs each (3)")
    of_field = studies.add_parser("field", help="what people really log, and what really happens to their robots")
    of_field.add_argument("--part", choices=("known", "further"), default="", help="one of the two parts (both)")
    of_field.add_argument("--only", nargs="*", default=[], help="names, beginnings of names or numbers of the cases")
    for study in (of_noise, of_effects, of_parking):
        study.add_argument("--seed", type=int, default=1, help="all cases follow from it (1)")
        study.add_argument("--only", type=int, nargs="*", default=[], help="numbers of the cases to run, from 0")
    for study in (of_noise, of_effects, of_parking, of_field):
        study.add_argument("--jobs", type=int, default=0, help="processes (one on each core)")
        study.add_argument("--out", type=Path, help="write the report here, and the cases beside it as .json")
        study.add_argument("--keep", type=Path, help="keep logs and results of every case below this folder")
    one = studies.add_parser("log", help="write one log with its truth")
    one.add_argument("folder", type=Path)
    one.add_argument("effects", nargs="*", help="turn_slip, hard_iron/slow, heading~ambient_c, …; none: a clean log")
    one.add_argument("--seed", type=int, default=1)
    one.add_argument("--condition", choices=CONDITIONS, default="usual")
    return parser


if __name__ == "__main__":
    main()
