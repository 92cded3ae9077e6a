"""What is found in a user's own files, and what is not claimed to be."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from sccal.errors import DataError, UsageError
from sccal.logs.run import discover, read_run
from sccal.logs.streams import Run
from sccal.logs.vehicle import read_mapping
from sccal.propose.place import place_for, write_new
from sccal.propose.propose import Proposal, Told, propose
from sccal.simulate.run import SimulatedRun
from tests.propose.logs import TICKS_PER_TURN, Form, drive, write_log
from tests.runs import written

DEGREES = Form(places="degrees", place_names=("lat", "lon"))
KNOWN = Told(ticks_per_turn=TICKS_PER_TURN)


@cache
def driven() -> SimulatedRun:
    return drive(7, 60.0)


def proposed(folder: Path, form: Form, told: Told = KNOWN) -> Proposal:
    """The proposal for the drive in that form, written beside it."""
    proposal = propose(write_log(driven(), form, folder), told)
    (folder / "vehicle.toml").write_text(proposal.text, encoding="utf-8")
    return proposal


def read(folder: Path) -> Run:
    (source,) = discover([folder])
    return read_run(source)


def wheel_travel(run: Run) -> tuple[float, float]:
    """Where both wheels end, in metres."""
    radius_m = run.vehicle.wheel_radius_m
    return radius_m * float(run.wheels.left_rad[-1]), radius_m * float(run.wheels.right_rad[-1])


def true_travel() -> tuple[float, float]:
    vehicle, angle = driven().settings.vehicle, driven().wheel_angle_rad
    return vehicle.radius_left_m * float(angle.left[-1]), vehicle.radius_right_m * float(angle.right[-1])


FORMS = {
    "the three files of the wish": Form(),
    "semicolons, decimal commas, UTF-16": replace(DEGREES, delimiter=";", decimal=",", encoding="utf-16"),
    "dates": replace(DEGREES, time="iso", time_name="stamp"),
    "dates and decimal commas": replace(DEGREES, time="iso", delimiter=";", decimal=","),
    "blanks between cells": replace(DEGREES, delimiter=" "),
    "nanoseconds since 1970": replace(DEGREES, time="unix_ns", time_name="t"),
    "local metres": replace(Form(), places="local", place_names=("x", "y")),
    "a quaternion": replace(DEGREES, heading="quaternion", heading_names=("qx", "qy", "qz", "qw"), clockwise=False),
    "radians under a name in degrees": replace(DEGREES, heading="rad", heading_names=("hdg_deg",)),
    "degrees under a name in radians": replace(DEGREES, heading_names=("yaw_rad",)),
    "one file": replace(DEGREES, one_file=True),
    "whatever sensors say": replace(DEGREES, rich=True),
    "whatever sensors say in one file": replace(DEGREES, rich=True, one_file=True),
    "sides under each other's names": replace(DEGREES, exchanged=True),
    "a counter that counts backwards": replace(DEGREES, reversed=(True, False)),
    "both counters that count backwards": replace(DEGREES, reversed=(True, True)),
    "counters of 16 bits": replace(DEGREES, wrap_bits=16),
    "wheels without sides in their names": replace(DEGREES, wheel_names=("M1", "M2"), exchanged=True),
    "latitude under the name of longitude": replace(DEGREES, place_names=("lon", "lat")),
    "a receiver with a clock of its own": replace(DEGREES, fix_time="iso"),
}


@pytest.mark.parametrize("name", FORMS)
def test_wheels_go_as_far_as_they_did_and_nothing_is_refused(tmp_path, name):
    proposal = proposed(tmp_path, FORMS[name])
    assert proposal.refusal == ""
    assert wheel_travel(read(tmp_path)) == pytest.approx(true_travel(), rel=0.03, abs=0.3)


@pytest.mark.parametrize("unit", ["rpm", "rad/s", "m/s", "m", "rad"])
@pytest.mark.parametrize("names", [("wheel_l", "wheel_r"), ("l_ticks", "r_ticks")])
def test_the_unit_of_the_wheels_is_told_by_their_size_and_not_by_their_name(tmp_path, unit, names):
    proposal = proposed(tmp_path, replace(DEGREES, wheels=unit, wheel_names=names), Told(radius_m=0.08))
    assert f'unit = "{unit}"' in proposal.text
    assert wheel_travel(read(tmp_path)) == pytest.approx(true_travel(), rel=0.03, abs=0.3)


@pytest.mark.parametrize(("clockwise", "convention"), [(True, "ned"), (False, "enu")])
def test_the_convention_is_that_in_which_the_heading_turns(tmp_path, clockwise, convention):
    proposal = proposed(tmp_path, replace(DEGREES, clockwise=clockwise))
    assert f'convention = "{convention}"' in proposal.text
    assert read(tmp_path).vehicle.convention == convention


def test_what_no_log_shows_is_said(tmp_path):
    proposal = proposed(tmp_path, Form(), Told())
    doubts = " ".join(proposal.doubts)
    assert "ticks per turn and wheel radius cannot be told apart by any log" in doubts
    assert "no number says which zone" in doubts
    assert "# stands in" in proposal.text
    vehicle = read(tmp_path).vehicle
    true = driven().settings.vehicle
    assert vehicle.ticks_per_rev is not None
    metres_per_tick = 2.0 * np.pi * vehicle.wheel_radius_m / vehicle.ticks_per_rev
    assert metres_per_tick == pytest.approx(
        np.pi * (true.radius_left_m + true.radius_right_m) / TICKS_PER_TURN, rel=0.03
    )


def test_the_users_word_is_taken(tmp_path):
    proposal = proposed(tmp_path, Form(), Told(ticks_per_turn=TICKS_PER_TURN, crs="epsg:32633").checked())
    assert 'crs = "EPSG:32633"' in proposal.text
    assert f"ticks_per_rev = {TICKS_PER_TURN}" in proposal.text
    assert proposal.doubts == ()


@pytest.mark.parametrize(
    "told", [Told(radius_m=-1.0), Told(ticks_per_turn=0.0), Told(crs="EPSG:4326"), Told(crs="UTM")]
)
def test_an_option_that_can_be_nothing_is_refused(told):
    with pytest.raises(UsageError):
        told.checked()


@pytest.mark.parametrize(("gone", "says"), [("wheel", "no wheels"), ("imu", "no heading"), ("gps", "no fixes")])
def test_a_log_without_one_of_its_streams_is_refused_with_what_was_seen(tmp_path, gone, says):
    folder = write_log(driven(), replace(DEGREES, rich=True), tmp_path)
    (folder / f"{gone}.csv").unlink()
    with pytest.raises(DataError, match=says) as refused:
        propose(folder, KNOWN)
    assert "nothing is written" in str(refused.value)
    assert gone not in str(refused.value).partition("Looked at:")[2].partition("known:")[0]


def test_of_two_headings_that_are_alike_one_is_taken_and_the_other_told(tmp_path):
    folder = write_log(driven(), DEGREES, tmp_path)
    rows = (folder / "imu.csv").read_text().splitlines()
    both = [f"{rows[0]},yaw2", *(f"{row},{row.split(',')[1]}" for row in rows[1:])]
    (folder / "imu.csv").write_text("\n".join(both) + "\n")
    proposal = propose(folder, KNOWN)
    assert any("heading: others go with the drive" in doubt and "yaw2" in doubt for doubt in proposal.doubts)


def test_a_course_over_ground_is_no_heading(tmp_path):
    folder = write_log(driven(), replace(DEGREES, rich=True), tmp_path)
    (folder / "imu.csv").unlink()
    with pytest.raises(DataError, match="no heading"):
        propose(folder, KNOWN)


def test_a_straight_drive_is_not_guessed_at(tmp_path):
    write_log(drive(7, 60.0, "straight"), DEGREES, tmp_path)
    with pytest.raises(DataError, match="no column turns"):
        propose(tmp_path, KNOWN)


def test_the_contracts_own_names_need_no_mapping(tmp_path):
    folder = written(tmp_path, duration_s=80.0)
    (folder / "vehicle.toml").unlink()
    proposal = propose(folder, Told(ticks_per_turn=32768))
    assert "[files" not in proposal.text
    assert proposal.refusal == ""


def test_sentences_under_another_name_are_found(tmp_path):
    folder = written(tmp_path, duration_s=80.0)
    for name, theirs in (("vehicle.toml", "old"), ("gnss.nmea", "rover.log"), ("ahrs.csv", "compass.csv")):
        (folder / name).rename(folder / theirs)
    proposal = propose(folder, Told(ticks_per_turn=32768))
    assert 'file = "rover.log"\nformat = "nmea"' in proposal.text
    assert "[files.encoder]" not in proposal.text
    assert proposal.refusal == ""


def test_files_with_dates_in_their_names_become_a_pattern(tmp_path):
    for day in ("01", "12"):
        files = (f"wheel_2024-05-{day}.csv", f"imu_2024-05-{day}.csv", f"gps_2024-05-{day}.csv")
        write_log(driven(), replace(DEGREES, files=files), tmp_path / day)
    proposal = propose(tmp_path, KNOWN)
    assert 'file = "wheel_*.csv"' in proposal.text
    (tmp_path / "vehicle.toml").write_text(proposal.text)
    assert [source.name for source in discover([tmp_path])] == ["01", "12"]


def test_names_that_are_an_attack_stay_text(tmp_path):
    names = ('l"]\n\x1b[2J', 'r"]\n\x1b[2J')
    folder = write_log(
        driven(), replace(DEGREES, wheel_names=(names[0].replace("\n", ""), names[1].replace("\n", ""))), tmp_path
    )
    proposal = propose(folder, KNOWN)
    (folder / "vehicle.toml").write_text(proposal.text, encoding="utf-8")
    assert read_mapping(folder / "vehicle.toml").sections["encoder"].uses["left"].columns == ('l"]\x1b[2J',)
    assert all(reason.isprintable() for reason in proposal.reasons)


def test_a_file_that_is_there_is_written_over_by_force_only(tmp_path):
    place = tmp_path / "vehicle.toml"
    place.write_text("mine")
    with pytest.raises(UsageError, match="--force"):
        place_for(tmp_path, None, force=False)
    with pytest.raises(UsageError, match="--force"):
        write_new(place, "theirs", force=False)
    assert place.read_text() == "mine"
    write_new(place_for(tmp_path, None, force=True), "theirs", force=True)
    assert place.read_text() == "theirs"
    assert [path.name for path in tmp_path.iterdir()] == ["vehicle.toml"]
