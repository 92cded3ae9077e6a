"""What a calibration wrote is read again as it was."""

import json

import numpy as np
import pytest

from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from sccal.errors import DataError, UsageError
from sccal.logs.inputs import input_files
from sccal.logs.run import discover
from sccal.report.write import write_numbers
from sccal.results.calibration import PARAMETERS
from sccal.results.converter import document_of
from sccal.results.files import calibration_file, read_calibration, read_trajectory
from tests.runs import read, written


@pytest.fixture(scope="module")
def calibration(tmp_path_factory):
    folder = written(tmp_path_factory.mktemp("saved") / "run", duration_s=60.0)
    return calibrate_run(read(folder), CalibrationOptions())[0]


def test_parameters_and_trajectory_are_what_was_calibrated(calibration, tmp_path):
    write_numbers(calibration, tmp_path)
    saved = read_calibration(calibration_file(tmp_path))
    assert saved.run == calibration.run
    assert not saved.of_vehicle
    assert tuple(saved.parameters.by_key) == PARAMETERS
    assert saved.parameters.track_m.value == calibration.parameters.track_m.value
    assert saved.parameters.track_m.sigma == calibration.parameters.track_m.sigma
    offset_deg = np.degrees(calibration.parameters.heading_offset_rad.value)
    assert saved.parameters.by_key["heading_offset_deg"].value == offset_deg
    path = read_trajectory(tmp_path)
    assert path.t_s.shape == calibration.trajectory.t_s.shape
    assert np.abs(path.east_m - calibration.trajectory.east_m).max() < 1e-3
    assert document_of(saved) == json.loads((tmp_path / "calibration.json").read_text())


def test_a_simulated_run_knows_when_it_began(calibration):
    assert calibration.started[:15] == "2024-06-01T12:0"


@pytest.mark.parametrize(
    ("content", "says"),
    [("{", "JSON"), ("[]", "schema"), ('{"schema": "sccal.diagnosis/1"}', "sccal.diagnosis/1")],
)
def test_what_is_no_calibration_is_refused_by_name(tmp_path, content, says):
    (tmp_path / "calibration.json").write_text(content)
    with pytest.raises(DataError, match=says) as caught:
        read_calibration(calibration_file(tmp_path))
    assert str(tmp_path / "calibration.json") in str(caught.value)


def test_half_a_calibration_is_refused(calibration, tmp_path):
    write_numbers(calibration, tmp_path)
    document = json.loads((tmp_path / "calibration.json").read_text())
    del document["parameters"]["track_m"]
    (tmp_path / "calibration.json").write_text(json.dumps(document))
    with pytest.raises(DataError, match="track_m"):
        read_calibration(calibration_file(tmp_path))


def test_a_folder_without_results_is_a_wrong_name(tmp_path):
    with pytest.raises(UsageError, match="holds no calibration"):
        calibration_file(tmp_path)
    with pytest.raises(UsageError, match="no such file"):
        calibration_file(tmp_path / "nowhere")


def test_inputs_change_with_every_file_that_is_read(tmp_path):
    folder = written(tmp_path / "run", duration_s=30.0)
    (source,) = discover([folder])
    before = {one.name: one.sha256 for one in input_files(source)}
    assert set(before) == {"encoder.csv", "ahrs.csv", "gnss.nmea", "vehicle.toml"}
    (folder / "vehicle.toml").write_text((folder / "vehicle.toml").read_text() + "\n")
    after = {one.name: one.sha256 for one in input_files(source)}
    assert {name for name in before if before[name] != after[name]} == {"vehicle.toml"}
