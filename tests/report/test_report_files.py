"""What lands on disk: contents that other programs read, whole or not at all."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from sccal.report.run.trajectory import trajectory_csv, trajectory_tum
from sccal.report.write import ros2_control_yaml, write_calibration, write_numbers, write_vehicle
from sccal.results.calibration import Calibration, Estimate, VehicleCalibration
from sccal.results.converter import document_of, json_text

FIVE = {"calibration.json", "trajectory.csv", "trajectory.tum", "ros2_control.yaml", "report.html"}


def strictly(text: str) -> Any:
    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    return json.loads(text, parse_constant=refuse)


def test_calibration_json_keeps_the_contract(a_run: Calibration) -> None:
    document = strictly(json_text(document_of(a_run)))
    assert document["schema"] == "sccal.calibration/1"
    assert (document["run"], document["vehicle"], document["variant"]) == (a_run.run, "tracked-demo", "sc_ekf_offset")
    assert list(document["parameters"]) == ["radius_right_m", "radius_left_m", "track_m", "heading_offset_deg"]
    offset = document["parameters"]["heading_offset_deg"]
    assert offset["value"] == pytest.approx(-3.2145)
    assert offset["sigma"] == pytest.approx(0.152)
    assert offset["status"] == "estimated"
    assert offset["prior_sigma"] == pytest.approx(180.0)
    assert document["parameters"]["track_m"]["nominal"] == 0.70
    assert document["origin"] == {"lat_deg": 37.525, "lon_deg": 15.074, "alt_m": 0.0}
    assert document["fit"]["heading_innovation_rms_deg"] == pytest.approx(0.91)
    assert {"gnss_innovation_rms_m", "nis_gnss", "nis_heading"} <= set(document["fit"])
    assert document["outage"]["windows"] == len(document["outage"]["each"]) == 8
    assert {"window_s", "rms_m", "end_rms_m", "percent_of_distance"} <= set(document["outage"])
    assert {"noise", "drive", "clock", "notices"} <= set(document)
    assert document["notices"][0]["text"] == "encoder.csv: 3 rows with text cells dropped (first at line 40)"


def test_what_is_not_a_number_is_null(an_ugly_run: Calibration) -> None:
    effects = {"lever_arm": {"forward_m": Estimate(np.float64(0.2), math.inf, "unobserved", "drive \udc80 faster")}}
    document = strictly(json_text(document_of(replace(an_ugly_run, effects=effects))))
    assert document["parameters"]["radius_left_m"]["sigma"] is None
    assert document["fit"]["gnss_innovation_rms_m"] is None
    assert document["outage"]["rms_m"] is None
    assert document["effects"]["lever_arm"]["forward_m"]["sigma"] is None
    json_text(document).encode("utf-8")


def test_heading_offset_is_wrapped(a_run: Calibration) -> None:
    turned = replace(a_run.parameters.heading_offset_rad, value=math.radians(190.0))
    document = document_of(replace(a_run, parameters=replace(a_run.parameters, heading_offset_rad=turned)))
    assert document["parameters"]["heading_offset_deg"]["value"] == pytest.approx(-170.0)


def test_vehicle_json_holds_its_runs(a_vehicle: VehicleCalibration) -> None:
    document = strictly(json_text(document_of(a_vehicle)))
    assert document["schema"] == "sccal.calibration/1"
    assert document["run"] == "(vehicle)"
    assert document["consistency_chi2_per_dof"] == 1.21
    assert [run["run"] for run in document["runs"]] == [c.run for c in a_vehicle.runs]
    assert document["runs"][2]["parameters"]["track_m"]["status"] == "unobserved"


def test_trajectory_csv_reads_back(a_run: Calibration) -> None:
    rows = list(csv.DictReader(trajectory_csv(a_run.trajectory).splitlines()))
    assert list(rows[0]) == ["t", "east_m", "north_m", "yaw_rad", "sigma_east_m", "sigma_north_m", "sigma_yaw_rad"]
    assert len(rows) == len(a_run.trajectory.t_s)
    for name, column, within in (
        ("t", a_run.trajectory.t_s, 1e-6),
        ("east_m", a_run.trajectory.east_m, 1e-4),
        ("north_m", a_run.trajectory.north_m, 1e-4),
        ("yaw_rad", a_run.trajectory.yaw_rad, 1e-6),
        ("sigma_yaw_rad", a_run.trajectory.sigma_yaw_rad, 1e-7),
    ):
        np.testing.assert_allclose([float(row[name]) for row in rows], column, rtol=0.0, atol=within)


def test_tum_holds_unit_quaternions_about_up(a_run: Calibration) -> None:
    table = np.loadtxt(trajectory_tum(a_run.trajectory).splitlines())
    assert table.shape == (len(a_run.trajectory.t_s), 8)
    assert not table[:, 3:6].any()
    np.testing.assert_allclose(np.hypot(table[:, 6], table[:, 7]), 1.0, atol=1e-8)
    turned = 2.0 * np.arctan2(table[:, 6], table[:, 7]) - a_run.trajectory.yaw_rad
    np.testing.assert_allclose(np.cos(turned), 1.0, atol=1e-12)


def ros_parameters(text: str) -> dict[str, Any]:
    parameters: dict[str, Any] = yaml.safe_load(text)["diff_drive_controller"]["ros__parameters"]
    return parameters


def test_ros2_control_multiplies_nominal_to_calibrated(a_run: Calibration) -> None:
    parameters = ros_parameters(ros2_control_yaml(a_run))
    assert all(isinstance(value, float) for value in parameters.values())
    assert parameters["wheel_separation"] * parameters["wheel_separation_multiplier"] == pytest.approx(0.71234)
    assert parameters["wheel_radius"] * parameters["left_wheel_radius_multiplier"] == pytest.approx(0.0799021)
    assert parameters["wheel_radius"] * parameters["right_wheel_radius_multiplier"] == pytest.approx(0.0808312)


def test_ros2_control_leaves_alone_what_was_not_estimated(an_ugly_run: Calibration) -> None:
    text = ros2_control_yaml(replace(an_ugly_run, run="broken\nname: [\x07"))
    parameters = ros_parameters(text)
    assert parameters["wheel_separation_multiplier"] == 1.0
    assert parameters["right_wheel_radius_multiplier"] == 1.0
    assert parameters["left_wheel_radius_multiplier"] == pytest.approx(0.99875)
    assert "wheel_separation_multiplier: 1.0  # not observed in this data: turned 2 deg in all" in text
    assert "right_wheel_radius_multiplier: 1.0  # stopped at its bound" in text


def test_ros2_control_of_a_whole_number_stays_a_double(a_vehicle: VehicleCalibration) -> None:
    track = replace(a_vehicle.parameters.track_m, nominal=1)
    wide = replace(a_vehicle, parameters=replace(a_vehicle.parameters, track_m=track))
    assert "wheel_separation: 1.0 " in ros2_control_yaml(wide)
    assert "3 runs together" in ros2_control_yaml(wide)


def test_a_run_leaves_its_five_files_and_nothing_else(tmp_path: Path, an_ugly_run: Calibration) -> None:
    folder = tmp_path / "out" / an_ugly_run.run
    write_calibration(an_ugly_run, folder)
    write_calibration(an_ugly_run, folder)
    assert {path.name for path in folder.iterdir()} == FIVE


def test_numbers_alone_come_without_a_page(tmp_path: Path, an_ugly_run: Calibration) -> None:
    write_numbers(an_ugly_run, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == FIVE - {"report.html"}


def test_a_vehicle_leaves_three_files_by_its_stem(tmp_path: Path, a_vehicle: VehicleCalibration) -> None:
    write_vehicle(a_vehicle, tmp_path, stem="tracked-demo")
    assert {path.name for path in tmp_path.iterdir()} == {
        "tracked-demo.json",
        "tracked-demo.html",
        "tracked-demo-ros2_control.yaml",
    }


def test_a_name_that_is_not_utf8_can_be_written(tmp_path: Path, an_ugly_run: Calibration) -> None:
    odd = replace(an_ugly_run, run="r\udce4um")
    write_calibration(odd, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == FIVE
    for path in tmp_path.iterdir():
        path.read_text(encoding="utf-8")
