"""The page of a vehicle: what its runs say together, and how they compare."""

from __future__ import annotations

from dataclasses import dataclass
from urllib.parse import quote

from sccal import __version__
from sccal.report.page import page
from sccal.report.rows import Row, effect_rows, parameter_rows
from sccal.report.run.advice import advice_on
from sccal.report.run.facts import fit_and_outage, variant
from sccal.report.sentences import missing_line, unseen_in_all, unseen_line, warnings_first
from sccal.report.vehicle.figures import vehicle_drawings
from sccal.results.calibration import Calibration, VehicleCalibration
from sccal.results.numbers import duration, one_line, plain, short
from sccal.results.verdict import Verdict


@dataclass(frozen=True)
class RunRow:
    """One line of the vehicle's table of runs."""

    name: str
    link: str
    rows: tuple[Row, ...]
    drift: str
    verdict: Verdict


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
        runs=[_run_row(c) for c in v.runs],
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


def _run_row(c: Calibration) -> RunRow:
    drift = "–" if c.outage.end_rms_m is None else plain(c.outage.end_rms_m, 2)
    link = "./" + quote(c.run, errors="replace") + "/report.html"
    return RunRow(one_line(c.run), link, parameter_rows(c.parameters), drift, c.verdict)
