"""report.html: the page of one run."""

from __future__ import annotations

from sccal import __version__
from sccal.report.page import page
from sccal.report.rows import effect_rows, parameter_rows
from sccal.report.run.advice import advice_on
from sccal.report.run.facts import driven_lines, fit_facts, narrowed_lines, origin_lines, started, variant
from sccal.report.run.figures import run_drawings
from sccal.report.sentences import clock_line, drive_line, noise_facts, warnings_first
from sccal.results.calibration import Calibration


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
        shown=narrowed_lines(c),
        driven=driven_lines(c.manoeuvres),
        origins=origin_lines(c.provenance) if c.provenance else (),
        notices=warnings_first(c.notices),
        origin=f"{c.origin.lat_deg:.7f}, {c.origin.lon_deg:.7f}",
        version=__version__,
        variant=variant(c.with_offset),
    )
