"""Results into folders; a reader meets each file whole or not at all."""

from __future__ import annotations

import importlib
import threading
from pathlib import Path

from sccal.logs.write import write_bytes, write_text
from sccal.report.calibration_mcap import write_calibration_mcap
from sccal.report.ros2_control import ros2_control_yaml
from sccal.report.trajectory import trajectory_csv, trajectory_tum
from sccal.results.calibration import Calibration, VehicleCalibration
from sccal.results.converter import document_of, json_text
from sccal.results.files import RESULT_FILE, TRAJECTORY_FILE

MCAP_FILE = "calibration.mcap"
PDF_FILE = "report.pdf"


def begin_loading() -> None:
    """Load what draws the pages beside other work: the filter leaves the interpreter free while it runs."""
    threading.Thread(target=importlib.import_module, args=("sccal.report.html",), daemon=True).start()


def write_numbers(c: Calibration, folder: Path) -> None:
    """Everything of a run but the page, and so without matplotlib: JSON, both trajectories, YAML."""
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / RESULT_FILE, json_text(document_of(c)))
    write_text(folder / TRAJECTORY_FILE, trajectory_csv(c.trajectory))
    write_text(folder / "trajectory.tum", trajectory_tum(c.trajectory))
    write_text(folder / "ros2_control.yaml", ros2_control_yaml(c))


def write_calibration(c: Calibration, folder: Path, with_mcap: bool = False, with_pdf: bool = False) -> None:
    """The five files of a run, and its calibration.mcap and report.pdf where they are wanted."""
    from sccal.report.html import run_html

    write_numbers(c, folder)
    write_text(folder / "report.html", run_html(c))
    if with_mcap:
        write_calibration_mcap(c, folder / MCAP_FILE)
    else:
        (folder / MCAP_FILE).unlink(missing_ok=True)
    if with_pdf:
        from sccal.report.pdf import run_pdf

        write_bytes(folder / PDF_FILE, run_pdf(c))
    else:
        (folder / PDF_FILE).unlink(missing_ok=True)


def write_vehicle(v: VehicleCalibration, out: Path, stem: str = "vehicle") -> None:
    """``<stem>.json`` and the parameters to deploy; for several runs a page, which expects their folders beside it."""
    out.mkdir(parents=True, exist_ok=True)
    write_text(out / f"{stem}.json", json_text(document_of(v)))
    yaml_name = "ros2_control.yaml" if stem == "vehicle" else f"{stem}-ros2_control.yaml"
    write_text(out / yaml_name, ros2_control_yaml(v))
    if len(v.runs) > 1:
        from sccal.report.html import vehicle_html

        write_text(out / f"{stem}.html", vehicle_html(v, json_link=f"{stem}.json"))
