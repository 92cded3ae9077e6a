"""report.html and the vehicle's page: one self-contained file each, readable on a phone, on paper, and in the dark."""

from __future__ import annotations

from dataclasses import dataclass
from urllib.parse import quote

from jinja2 import Environment, PackageLoader, StrictUndefined

from sccal import __version__
from sccal.report.advice import advice_on
from sccal.report.facts import driven_lines, fit_and_outage, fit_facts, origin_lines, shown_lines, started, variant
from sccal.report.figures_run import run_drawings
from sccal.report.figures_vehicle import vehicle_drawings
from sccal.report.rows import Row, effect_rows, parameter_rows
from sccal.report.summary import (
    clock_line,
    drive_line,
    missing_line,
    noise_facts,
    unseen_in_all,
    unseen_line,
    warnings_first,
)
from sccal.results.calibration import Calibration, VehicleCalibration
from sccal.results.numbers import duration, one_line, plain, short
from sccal.results.verdict import Verdict

_PAGES = Environment(
    loader=PackageLoader("sccal.report", "templates"),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    keep_trailing_newline=True,
)


@dataclass(frozen=True)
class RunLine:
    """One line of the vehicle's table of runs."""

    name: str
    link: str
    rows: tuple[Row, ...]
    drift: str
    verdict: Verdict


def run_html(c: Calibration) -> str:
    """The page of one run."""
    verdict = c.verdict
    return page(
        "run.html.j2",
        c=c,
        verdict=verdict,
        advice=advice_on(c, verdict),
        date=started(c),
        rows=(*parameter_rows(c.parameters), *effect_rows(c.effects)),
        drive=drive_line(c.drive),
        drawings=run_drawings(c),
        fit=fit_facts(c),
        noise=(*noise_facts(c.noise), ("clock", clock_line(c.clock))),
        shown=shown_lines(c),
        driven=driven_lines(c.manoeuvres),
        origins=origin_lines(c.provenance) if c.provenance else (),
        notices=warnings_first(c.notices),
        origin=f"{c.origin.lat_deg:.7f}, {c.origin.lon_deg:.7f}",
        version=__version__,
        variant=variant(c.with_offset),
    )


def vehicle_html(v: VehicleCalibration, json_link: str = "vehicle.json") -> str:
    """The page of several runs; it links to each run's own page, ``<run>/report.html``."""
    verdict = v.verdict
    count = f"{len(v.runs)} run{'' if len(v.runs) == 1 else 's'}"
    time = duration(sum(c.drive.duration_s for c in v.runs))
    chi2 = v.consistency_chi2_per_dof
    agreement = "" if chi2 is None else f"agree to chi2 per dof {short(chi2, 3)} (1 is consistent)"
    return page(
        "vehicle.html.j2",
        v=v,
        verdict=verdict,
        advice=advice_on(v, verdict),
        rows=(*parameter_rows(v.parameters), *effect_rows(v.effects)),
        runs=[_run_line(c) for c in v.runs],
        total=f"{count} · {time} · {plain(sum(c.drive.distance_m for c in v.runs))} m",
        drawings=vehicle_drawings(v),
        fit=(
            ("runs", agreement),
            *fit_and_outage(v.fit, v.outage, v.held_out),
            ("lacks", missing_line(v.missing)),
            ("unseen", unseen_line(unseen_in_all([c.unseen for c in v.runs]))),
        ),
        notices=warnings_first(v.notices),
        version=__version__,
        variant=variant(v.with_offset),
        json_link=json_link,
    )


def page(template: str, **content: object) -> str:
    """Names from a file system may hold what UTF-8 cannot; it becomes a question mark."""
    return _PAGES.get_template(template).render(content).encode("utf-8", "replace").decode("utf-8")


def _run_line(c: Calibration) -> RunLine:
    drift = "–" if c.outage.end_rms_m is None else plain(c.outage.end_rms_m, 2)
    link = "./" + quote(c.run, errors="replace") + "/report.html"
    return RunLine(one_line(c.run), link, parameter_rows(c.parameters), drift, c.verdict)
