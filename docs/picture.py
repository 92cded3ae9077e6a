"""Draw the README's pictures.

``python docs/picture.py calibration sample_logs/general docs/calibration.svg`` and
``python docs/picture.py diagnosis LOGS docs/diagnosis.svg``, LOGS the runs of the van that the README names;
``python docs/picture.py drives docs/drives.svg`` for the page on logging.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from matplotlib.figure import Figure

from sccal.align import align
from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from sccal.diagnose.diagnose import diagnose
from sccal.effects.catalogue import CATALOGUE
from sccal.inspect.inspect import inspect_run
from sccal.logs.run import discover, read_run
from sccal.logs.write import write_text
from sccal.report.diagnosis.figures import residual_plot
from sccal.report.drawing.plan import drawn
from sccal.report.drawing.style import BLUE, PAPER, plain_ticks, styled, svg_text
from sccal.report.rows import Row, parameter_rows
from sccal.report.run.figure_series import parameters_plan
from sccal.results.calibration import Calibration
from sccal.results.numbers import plain
from sccal.simulate.choose import settings_from
from sccal.simulate.files import write_run, write_vehicle_file
from sccal.simulate.run import simulate_run


def calibration(logs: str) -> str:
    """The parameters of one run as the filter learns them."""
    (source,) = discover([Path(logs)])
    found, _ = calibrate_run(read_run(source), CalibrationOptions())
    return drawn(parameters_plan(found)).svg


def diagnosis(logs: str) -> str:
    """The residual of the first finding against its cause, without and with it."""
    found = diagnose([align(read_run(source)) for source in discover([Path(logs)])], CalibrationOptions())
    picture = found.findings[0].picture
    assert picture is not None
    return residual_plot(picture)


_OF_THE_PAGE = re.compile(r"var\(--[a-z]+,([^()]*)\)")
"""A value that a page may choose, and the one that holds where there is no page."""


def standing_alone(svg: str) -> str:
    """The figure without a page around it: with colours and letters of its own, on white paper."""
    head, body = _OF_THE_PAGE.sub(r"\1", svg).split(">", 1)
    return f'{head}>\n<rect width="100%" height="100%" fill="{PAPER}"/>{body}'


DRIVES = ("straight", "circle", "rows", "rectangle", "figure8", "calibration")
DRIVE_S = 320.0


def drives() -> str:
    """Six drives of one robot, and what each says about radii, track and heading offset."""
    with styled("drives"):
        figure = Figure(figsize=(8.4, 7.0))
        for k, path in enumerate(DRIVES):
            axes = figure.add_axes((0.05 + 0.325 * (k % 3), 0.68 - 0.5 * (k // 3), 0.26, 0.28))
            found, shows = driven(path)
            axes.plot(found.trajectory.east_m, found.trajectory.north_m, color=BLUE, lw=1.0)
            axes.set_aspect("equal", adjustable="datalim")
            axes.margins(0.1)
            plain_ticks(axes, 3)
            axes.set_title(f"{path} (m)", fontweight="bold" if path == "calibration" else "normal")
            lines = [f"{row.name}: {shown(row)}" for row in parameter_rows(found.parameters)]
            lines.append(f"effects shown: {shows}")
            axes.text(0.0, -0.14, "\n".join(lines), transform=axes.transAxes, va="top", fontsize=8.0, linespacing=1.35)
        return svg_text(figure)


def driven(path: str) -> tuple[Calibration, str]:
    """A simulated drive, calibrated; and how many effects of the catalogue it shows alone, of those asked."""
    with TemporaryDirectory() as name:
        settings = settings_from([f"drive.path={path}", f"drive.duration_s={DRIVE_S}"], 1)
        write_run(simulate_run(settings), Path(name) / path)
        write_vehicle_file(settings, Path(name) / path)
        (source,) = discover([Path(name)])
        excited = [one for one in inspect_run(source, None).excited if one.name in CATALOGUE]
        shows = f"{sum(one.shown == 'yes' for one in excited)} of {len(excited)}"
        return calibrate_run(read_run(source), CalibrationOptions())[0], shows


def shown(row: Row) -> str:
    """The sigma of what was estimated, or that it was not."""
    if row.estimate.status != "estimated":
        return row.status
    scale, unit = (1e3, "mm") if row.unit == "m" else (1.0, "°")
    return f"± {plain(scale * row.estimate.sigma, 2)} {unit}"


PICTURES = {"calibration": calibration, "diagnosis": diagnosis, "drives": drives}

if __name__ == "__main__":
    kind, *logs, picture = sys.argv[1:]
    write_text(Path(picture), standing_alone(PICTURES[kind](*logs)))
