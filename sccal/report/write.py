"""Results into folders, all of them in one way; a reader meets each file whole or not at all."""

from __future__ import annotations

import importlib
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from sccal.export.result import Result
from sccal.export.ros2_control import write_ros2_control
from sccal.logs.write import write_bytes
from sccal.report.run.mcap import write_calibration_mcap
from sccal.report.run.trajectory import trajectory_csv, trajectory_tum
from sccal.results.calibration import Calibrated, Calibration, VehicleCalibration
from sccal.results.converter import document_of, json_text
from sccal.results.files import DIAGNOSIS_FILE, MODEL_FILE, RESULT_FILE, SUMMARY_FILE, TRAJECTORY_FILE

if TYPE_CHECKING:
    from sccal.results.diagnosis import Diagnosis
    from sccal.results.experiments import Experiments
    from sccal.results.inspection import Inspection
    from sccal.results.summary import Summary

MCAP_FILE = "calibration.mcap"
PDF_FILE = "report.pdf"

Content = Callable[[], str | bytes]


def begin_loading() -> None:
    """Load what draws the pages beside other work: the filter leaves the interpreter free while it runs."""
    threading.Thread(target=importlib.import_module, args=("sccal.report.run.page",), daemon=True).start()


def write_files(folder: Path, files: Mapping[str, Content]) -> None:
    """One after the other, each made when it is its turn: documents are there before anything is drawn."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, made in files.items():
        content = made()
        write_bytes(folder / name, content.encode("utf-8") if isinstance(content, str) else content)


def document(result: object) -> Content:
    """A result as its JSON."""
    return lambda: json_text(document_of(result))


def write_numbers(c: Calibration, folder: Path) -> None:
    """Everything of a run but the page, and so without matplotlib: JSON, both trajectories, YAML."""
    files: dict[str, Content] = {
        RESULT_FILE: document(c),
        TRAJECTORY_FILE: lambda: trajectory_csv(c.trajectory),
        "trajectory.tum": lambda: trajectory_tum(c.trajectory),
        "ros2_control.yaml": lambda: ros2_control_yaml(c),
    }
    write_files(folder, files)


def write_calibration(c: Calibration, folder: Path, with_mcap: bool = False, with_pdf: bool = False) -> None:
    """The five files of a run, and its calibration.mcap and report.pdf where they are wanted."""
    from sccal.report.run.page import run_html

    write_numbers(c, folder)
    write_files(folder, {"report.html": lambda: run_html(c)})
    if with_mcap:
        write_calibration_mcap(c, folder / MCAP_FILE)
    else:
        (folder / MCAP_FILE).unlink(missing_ok=True)
    if with_pdf:
        from sccal.report.run.pdf import run_pdf

        write_files(folder, {PDF_FILE: lambda: run_pdf(c)})
    else:
        (folder / PDF_FILE).unlink(missing_ok=True)


def write_vehicle(v: VehicleCalibration, out: Path, stem: str = "vehicle") -> None:
    """``<stem>.json`` and the parameters to deploy; for several runs a page, which expects their folders beside it."""
    yaml_name = "ros2_control.yaml" if stem == "vehicle" else f"{stem}-ros2_control.yaml"
    write_files(out, {f"{stem}.json": document(v), yaml_name: lambda: ros2_control_yaml(v)})
    if len(v.runs) > 1:
        from sccal.report.vehicle.page import vehicle_html

        write_files(out, {f"{stem}.html": lambda: vehicle_html(v, json_link=f"{stem}.json")})


def ros2_control_yaml(calibrated: Calibrated) -> str:
    """What ``sccal export ros2_control`` makes of the same results."""
    return write_ros2_control(Result.of(calibrated, Path()))


def write_diagnosis(d: Diagnosis, out: Path) -> None:
    """``diagnosis.json`` and ``model.json``, then the page ``diagnosis.html``."""

    def page() -> str:
        from sccal.report.diagnosis.page import diagnosis_html

        return diagnosis_html(d)

    write_files(out, {DIAGNOSIS_FILE: document(d), MODEL_FILE: document(d.model), "diagnosis.html": page})


def write_inspection(i: Inspection, folder: Path) -> Path:
    """``inspect.json``, then ``inspect.html``, whose path is returned."""
    from sccal.results.inspection import Inspections

    def page() -> str:
        from sccal.report.inspection.page import inspection_html

        return inspection_html(i)

    write_files(folder, {"inspect.json": document(Inspections((i,))), "inspect.html": page})
    return folder / "inspect.html"


def write_summary(summary: Summary, out: Path) -> Path:
    """summary.json, summary.csv and index.html, which expects the runs' folders beside it; returns the page."""
    from sccal.report.fleet.lines import with_sentences
    from sccal.report.fleet.table import summary_csv

    summary = with_sentences(summary)

    def page() -> str:
        from sccal.report.fleet.page import index_html

        return index_html(summary)

    write_files(out, {SUMMARY_FILE: document(summary), "summary.csv": lambda: summary_csv(summary), "index.html": page})
    return out / "index.html"


def write_experiments(e: Experiments, out: Path) -> Path:
    """``experiments.json``, then ``experiments.html``, whose path is returned."""

    def page() -> str:
        from sccal.report.experiments.page import experiments_html

        return experiments_html(e)

    write_files(out, {"experiments.json": document(e), "experiments.html": page})
    return out / "experiments.html"
