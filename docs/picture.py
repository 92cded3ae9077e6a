"""Draw the README's pictures.

``python docs/picture.py calibration sample_logs/general docs/calibration.svg`` and
``python docs/picture.py diagnosis LOGS docs/diagnosis.svg``, LOGS the runs of the van that the README names.
"""

from __future__ import annotations

import sys
from pathlib import Path

from sccal.align import align
from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from sccal.diagnose.diagnose import diagnose
from sccal.logs.run import discover, read_run
from sccal.logs.write import write_text
from sccal.report.diagnosis_figures import residual_picture
from sccal.report.figures import parameter_history


def calibration(logs: str) -> str:
    """The parameters of one run as the filter learns them."""
    (source,) = discover([Path(logs)])
    found, _ = calibrate_run(read_run(source), CalibrationOptions())
    return parameter_history(found)


def diagnosis(logs: str) -> str:
    """The residual of the first finding against its cause, without and with it."""
    found = diagnose([align(read_run(source)) for source in discover([Path(logs)])], CalibrationOptions())
    picture = found.findings[0].picture
    assert picture is not None
    return residual_picture(picture)


if __name__ == "__main__":
    kind, logs, picture = sys.argv[1:]
    write_text(Path(picture), {"calibration": calibration, "diagnosis": diagnosis}[kind](logs))
