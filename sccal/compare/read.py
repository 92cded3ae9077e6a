"""The two results that ``sccal compare`` is given: files, or folders that hold one."""

from __future__ import annotations

from pathlib import Path

from sccal.compare.calibrations import compare_calibrations
from sccal.compare.diagnoses import compare_diagnoses
from sccal.errors import DataError, UsageError
from sccal.results.calibration import CALIBRATION_SCHEMA
from sccal.results.comparison import Comparison, Kind
from sccal.results.converter import read_json
from sccal.results.diagnosis import Diagnosis
from sccal.results.files import DIAGNOSIS_FILE, RESULT_FILE, VEHICLE_FILE, read_calibration, read_diagnosis

KINDS: dict[str, Kind] = {CALIBRATION_SCHEMA: "calibration", Diagnosis.SCHEMA: "diagnosis"}
"""By schema."""


def compare_paths(a: Path, b: Path, sigmas: float) -> Comparison:
    """Read both and compare them. A folder with results of both kinds is read as the other side's kind.

    Raises:
        UsageError: no such file, nothing to compare in a folder, or a calibration against a diagnosis.
        DataError: a file is damaged or of another schema.
    """
    there_a, there_b = _results_at(a), _results_at(b)
    common = [kind for kind in there_a if kind in there_b]
    if not common:
        raise UsageError(
            f"{a} is a {' and a '.join(there_a)}, {b} a {' and a '.join(there_b)}: "
            "compare two calibrations or two diagnoses"
        )
    if len(common) > 1:
        raise UsageError(
            f"{a} and {b} hold a calibration and a diagnosis each; name two files, as {there_a['calibration']} "
            f"or {there_a['diagnosis']}"
        )
    file_a, file_b = there_a[common[0]], there_b[common[0]]
    names = str(file_a), str(file_b)
    if common[0] == "calibration":
        return compare_calibrations(read_calibration(file_a), read_calibration(file_b), sigmas, names)
    return compare_diagnoses(read_diagnosis(file_a), read_diagnosis(file_b), sigmas, names)


def _results_at(path: Path) -> dict[Kind, Path]:
    if not path.exists():
        raise UsageError(f"{path}: no such file or folder")
    if path.is_dir():
        kinds: tuple[tuple[Kind, str], ...] = (
            ("calibration", RESULT_FILE),
            ("calibration", VEHICLE_FILE),
            ("diagnosis", DIAGNOSIS_FILE),
        )
        there: dict[Kind, Path] = {}
        for kind, name in kinds:
            if (path / name).is_file():
                there.setdefault(kind, path / name)
        if not there:
            names = f"{RESULT_FILE}, {VEHICLE_FILE} or {DIAGNOSIS_FILE}"
            raise UsageError(f"{path}: holds no {names}; name a file, or the folder of one run's results, as OUT/run")
        return there
    _, schema = read_json(path)
    if schema is None or schema not in KINDS:
        raise DataError(f"{path}: its schema is {schema!r}; compare files of {' or of '.join(KINDS)}")
    return {KINDS[schema]: path}
