"""What the robot did, whether the streams agree about it, and what it can show."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sccal.evidence.confounding import reduced
from tests.inspect.conftest import REVERSES_M, STANDS_S
from tests.inspect.logs import copied, inspected, rows, said, shown, witness
from tests.runs import written

SIGNS = ("yaw against wheels", "course of the fixes against wheels", "course of the fixes against yaw")


def test_distance_and_direction(general):
    drive = general.drive
    assert drive.distance_fixes_m == pytest.approx(drive.distance_wheels_m, rel=0.03)
    assert REVERSES_M < drive.reversed_m < drive.distance_wheels_m
    assert (general.series.speed_wheels_mps[: int(2 * STANDS_S) - 1] == 0.0).all()
    after = general.series.speed_wheels_mps[int(2 * (STANDS_S + 3.0)) : int(2 * (STANDS_S + 8.0))]
    assert (after < -0.2).all()
    wheels, fixes = general.series.speed_wheels_mps, general.series.speed_fixes_mps
    assert drive.reversed_m == pytest.approx(-0.5 * wheels[wheels < 0].sum(), rel=0.02)
    both = np.isfinite(fixes) & (np.abs(wheels) > 0.2)
    assert np.quantile(np.abs(fixes[both] - wheels[both]), 0.9) < 0.1
    assert drive.speed_max_mps == pytest.approx(np.nanmax(np.abs(general.series.speed_wheels_mps)))
    assert drive.by == "wheels"


def test_the_first_standstill_and_its_noise(general):
    assert general.series.standing_s[0, 1] - general.span_s[0] == pytest.approx(STANDS_S, abs=1.0)
    still = general.standstill
    assert 0.008 < still.fixes_m < 0.016
    assert np.radians(0.1) < still.yaw_rad < np.radians(0.4)
    assert still.gyro_radps is None


@pytest.mark.parametrize("convention", ["enu", "ned"])
def test_left_is_left(tmp_path, convention):
    run = written(tmp_path / "run", f"ahrs.convention={convention}", path="circle", duration_s=90.0)
    left = inspected(run).drive
    assert left.turned_left_rad > 3.0 > left.turned_right_rad
    (run / "encoder.csv").unlink()
    assert inspected(run).drive.turned_left_rad == pytest.approx(left.turned_left_rad, rel=0.1)


def test_pieces_of_rows(tmp_path):
    drive = inspected(written(tmp_path / "run", path="rows", duration_s=200.0)).drive
    assert drive.pivots >= 2
    assert 3 <= drive.straights <= 8
    assert drive.arcs == 0


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_straight_line(tmp_path, seed):
    found = inspected(written(tmp_path / "run", path="straight", duration_s=120.0, seed=seed))
    assert (found.drive.straights, found.drive.arcs, found.drive.pivots, found.drive.headings) == (1, 0, 0, 1)
    assert found.drive.turned_left_rad + found.drive.turned_right_rad < np.radians(20.0)
    assert not any(witness(found, what).clear for what in SIGNS)
    assert witness(found, "distance").clear
    told = shown(found)
    assert told["radii"] == told["heading_offset"] == "yes"
    assert told["track"] == told["lever_arm"] == told["hard_iron"] == told["turn_slip"] == "no"


def test_a_good_drive_shows_much(general):
    told = shown(general)
    for name in ("radii", "track", "heading_offset", "lever_arm", "hard_iron", "soft_iron"):
        assert told[name] == "yes", name
    assert told["slope"] == told["roll_slip"] == "no"
    assert general.excited_how.startswith("one pass")
    assert not general.refused


def test_one_speed_and_one_side_tell_less(general, tmp_path):
    found = inspected(written(tmp_path / "run", path="circle", duration_s=150.0))
    told = shown(found)
    assert told["speed_slip"] == told["turn_slip"] == told["side_slip"] == "no"
    arm, before = (next(one for one in i.excited if one.name == "lever_arm") for i in (found, general))
    assert told["lever_arm"] != "yes"
    assert arm.sigmas["forward_m"] > 5.0 * before.sigmas["forward_m"]
    assert witness(found, "yaw").meaning == ""


def test_the_expected_sigmas_are_those_of_a_calibration(general, general_run):
    from sccal.calibration.options import CalibrationOptions
    from sccal.calibration.single import calibrate_run
    from tests.runs import read

    found = calibrate_run(read(general_run), CalibrationOptions())[0].parameters
    expected = {name: sigma for one in general.excited for name, sigma in one.sigmas.items()}
    for name, sigma in (
        ("radius_right_m", found.radius_right_m.sigma),
        ("track_m", found.track_m.sigma),
        ("heading_offset_deg", np.degrees(found.heading_offset_rad.sigma)),
    ):
        assert sigma / 3.0 < expected[name] < 3.0 * sigma, name


def test_marginalising_is_inverting_all_and_taking_a_part():
    rng = np.random.default_rng(4)
    root = rng.normal(size=(9, 7))
    information = root.T @ root
    small = rng.uniform(0.1, 2.0, 7)
    kept = np.array([1, 4])
    others = np.setdiff1d(np.arange(7), kept)
    whole = information.copy()
    whole[others, others] += 1.0 / small[others] ** 2
    expected = np.linalg.inv(np.linalg.inv(whole)[np.ix_(kept, kept)])
    np.testing.assert_allclose(reduced(information, kept, small), expected, rtol=1e-9)


# Signs


def test_all_signs_are_right(general):
    for what in SIGNS:
        assert witness(general, what).clear
        assert witness(general, what).slope > 0.8, what
    assert "track of about 0.7" in witness(general, "yaw against wheels").meaning
    assert witness(general, "distance").slope == pytest.approx(0.0802 / 0.08, rel=0.01)


def test_swapped_wheels(spoilt):
    rows(spoilt / "encoder.csv", lambda t, row: [row[0], row[2], row[1]])
    found = inspected(spoilt)
    assert [witness(found, what).slope > 0 for what in SIGNS] == [False, False, True]
    assert said(found, "look swapped").weight == "refused"
    (spoilt / "ahrs.csv").unlink()
    assert "swapped" in said(inspected(spoilt), "turns against the wheels").text


def test_a_wrong_convention(spoilt):
    path = spoilt / "vehicle.toml"
    path.write_text(path.read_text().replace('"enu"', '"ned"'))
    found = inspected(spoilt)
    assert [witness(found, what).slope > 0 for what in SIGNS] == [False, True, False]
    assert said(found, 'convention = "enu"').weight == "refused"
    (spoilt / "encoder.csv").unlink()
    assert "convention" in said(inspected(spoilt), "turns against the yaw").text


def test_a_wheel_that_counts_backwards(spoilt):
    rows(spoilt / "encoder.csv", lambda t, row: [row[0], str(-int(row[1])), row[2]])
    found = inspected(spoilt)
    assert "left_ticks" in said(found, "count backwards").text
    assert found.excited_how.startswith("rules of thumb")


@pytest.mark.parametrize("offset_deg", [12.5, -120.0, 178.0])
def test_the_heading_offset_has_its_sign(general, spoilt, offset_deg):
    """In reverse as well: the run begins with it."""
    truth = json.loads((spoilt / "truth.json").read_text())["parameters"]["heading_offset_deg"]
    rows(spoilt / "ahrs.csv", lambda t, row: [row[0], f"{float(row[1]) + offset_deg - truth:.4f}", *row[2:]])
    course = inspected(spoilt).course
    assert np.degrees(course.offset_rad) == pytest.approx(offset_deg, abs=1.0)
    assert course.spread_rad < np.radians(2.0)
    assert course.legs >= 8


def test_the_heading_offset_of_a_robot_that_reverses(tmp_path):
    run = written(tmp_path / "run", "drive.reverse_first_m=40", path="straight", duration_s=90.0)
    found = inspected(run)
    assert found.drive.reversed_m > 0.6 * found.drive.distance_wheels_m
    assert np.degrees(found.course.offset_rad) == pytest.approx(12.5, abs=1.5)


def test_a_compass_that_errs_is_noticed(spoilt, general):
    def iron(t, row):
        yaw_deg = float(row[1])
        return [row[0], f"{yaw_deg + 20.0 * np.sin(np.radians(yaw_deg)):.4f}", *row[2:]]

    rows(spoilt / "ahrs.csv", iron)
    assert said(inspected(spoilt), "beside a constant offset").weight == "warning"
    assert said(general, "beside a constant offset") is None


def test_a_wrong_scale(spoilt):
    path = spoilt / "vehicle.toml"
    path.write_text(path.read_text().replace("0.08", "0.1"))
    found = inspected(spoilt)
    assert witness(found, "distance").slope == pytest.approx(0.802, rel=0.01)
    assert "ticks_per_rev" in said(found, "times as far as the wheels").text


def test_frozen_sensors(spoilt, general):
    held: list[str] = []

    def freeze(t, row):
        if not 60.0 < t < 100.0:
            return row
        held.extend([row[1]] * (not held))
        return [row[0], held[0], *row[2:]]

    rows(spoilt / "ahrs.csv", freeze)
    assert said(inspected(spoilt), "the yaw repeats one value for 39.").weight == "warning"
    assert said(general, "repeat") is None


def test_a_robot_that_stands(tmp_path):
    run = written(tmp_path / "run", "drive.stand_first_s=40", path="straight", duration_s=40.0)
    found = inspected(run)
    assert found.refused
    assert said(found, "hardly moves") is not None
    assert found.drive.distance_wheels_m < 0.5
    assert found.standstill.seconds > 30.0


def test_an_encoder_that_does_not_count(spoilt):
    rows(spoilt / "encoder.csv", lambda t, row: [row[0], "5", "5"])
    assert "while the fixes move" in said(inspected(spoilt), "the wheels hardly turn").text


def test_a_further_copy_gives_the_same(general_run, general, tmp_path):
    again = inspected(copied(general_run, tmp_path))
    assert again.findings == general.findings
    assert again.drive == general.drive
    assert [one.sigmas for one in again.excited] == [one.sigmas for one in general.excited]
