"""Draw the README's picture from one run: ``python docs/picture.py sample_logs/general docs/calibration.svg``."""

from __future__ import annotations

import sys
from pathlib import Path

from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from sccal.logs.run import discover, read_run
from sccal.logs.write import write_text
from sccal.report.figures import parameter_history


def main(run: str, picture: str) -> None:
    (source,) = discover([Path(run)])
    calibration, _ = calibrate_run(read_run(source), CalibrationOptions())
    write_text(Path(picture), parameter_history(calibration))


if __name__ == "__main__":
    main(*sys.argv[1:])
