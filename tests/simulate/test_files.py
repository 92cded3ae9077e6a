"""A simulated run on disk: the format's own columns and lines, the truth, the same bytes for the same seed."""

import json
import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from sccal.logs.run import discover, read_run
from sccal.simulate.files import write_run, write_samples, write_vehicle_file
from sccal.simulate.physics import Physics
from sccal.simulate.run import simulate_run
from sccal.simulate.settings import (
    AhrsSettings,
    ClockSettings,
    DriveSettings,
    EncoderSettings,
    GnssSettings,
    SimulationSettings,
)

SHORT = SimulationSettings(drive=DriveSettings(path="circle", duration_s=30.0), gnss=GnssSettings(with_gst=True))


def written(folder, settings):
    write_run(simulate_run(settings), folder)
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_a_run_has_its_files_and_columns(tmp_path):
    files = written(tmp_path, SHORT)
    assert list(files) == ["ahrs.csv", "encoder.csv", "gnss.nmea", "truth.json"]
    assert files["encoder.csv"].startswith(b"t,left_ticks,right_ticks\n")
    assert files["ahrs.csv"].startswith(b"t,yaw_deg,pitch_deg,roll_deg\n")
    assert all(b"\r" not in content.replace(b"\r\n", b"") for content in files.values())
    table = np.loadtxt(tmp_path / "encoder.csv", delimiter=",", skiprows=1)
    run = simulate_run(SHORT)
    assert table[:, 0] == pytest.approx(run.encoder.host_t_s, abs=6e-5)
    assert np.array_equal(table[:, 2].astype(int), run.encoder.right_ticks)
    headings = np.loadtxt(tmp_path / "ahrs.csv", delimiter=",", skiprows=1)
    assert headings[:, 1] == pytest.approx(run.ahrs.yaw_deg, abs=1e-9)


def test_the_same_seed_gives_the_same_bytes_and_another_does_not(tmp_path):
    one, again = written(tmp_path / "one", SHORT), written(tmp_path / "again", SHORT)
    other = written(tmp_path / "other", replace(SHORT, seed=1))
    assert one == again
    assert all(one[name] != other[name] for name in one)


def test_sentences_come_at_their_rates_with_receive_times_in_order(tmp_path):
    lines = written(tmp_path, SHORT)["gnss.nmea"].decode("ascii").splitlines()
    kinds = [re.fullmatch(r"\d+\.\d{4} \$..([A-Z]{3}),[^*]*\*[0-9A-F]{2}", line)[1] for line in lines]
    assert kinds.count("GGA") == kinds.count("GST") == 30 * 5 + 1
    assert kinds.count("RMC") == kinds.count("ZDA") == 30 + 1
    assert all(",R*" in line for line, kind in zip(lines, kinds, strict=True) if kind == "RMC")
    times = [float(line.split()[0]) for line in lines]
    assert all(np.diff(times) > 0)
    bare = replace(SHORT, gnss=GnssSettings(with_host_time=False))
    write_run(simulate_run(bare), tmp_path / "bare")
    assert (tmp_path / "bare" / "gnss.nmea").read_text().startswith("$")


def test_truth_says_what_was_true(tmp_path):
    settings = replace(SHORT, ahrs=AhrsSettings(heading_offset_deg=190.0), seed=4)
    truth = json.loads(written(tmp_path, settings)["truth.json"])
    assert truth["parameters"] == {
        "radius_right_m": 0.0808,
        "radius_left_m": 0.0796,
        "track_m": 0.728,
        "heading_offset_deg": -170.0,
    }
    assert truth["seed"] == 4
    assert truth["settings"]["drive"]["path"] == "circle"
    assert truth["path"]["distance_m"] == pytest.approx(0.6 * 30 - 0.36, abs=0.01)
    assert truth["path"]["turned_right_deg"] == 0
    assert truth["path"]["reversed_m"] == 0


def test_truth_names_the_effects_that_acted(tmp_path):
    class Slipping(Physics):
        def truth(self):
            return {"turn_slip": {"per_radps": 0.1}}

    write_run(simulate_run(SHORT, [Slipping()]), tmp_path)
    effects = json.loads((tmp_path / "truth.json").read_text())["effects"]
    assert effects == {"lever_arm": {"forward_m": 0.0, "left_m": 0.0}, "turn_slip": {"per_radps": 0.1}}


def test_the_vehicle_file_declares_nominal_values(tmp_path):
    settings = SimulationSettings(encoder=EncoderSettings(counter_bits=16), ahrs=AhrsSettings(convention="ned"))
    declared = tomllib.loads(write_vehicle_file(settings, tmp_path / "deep").read_text())
    assert declared["encoder"] == {"ticks_per_rev": 32768, "counter_bits": 16}
    assert declared["nominal"] == {"wheel_radius_m": 0.08, "track_m": 0.7}
    assert declared["ahrs"] == {"convention": "ned"}


def test_samples_are_three_small_runs_of_one_vehicle(tmp_path):
    write_samples(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["circle", "general", "rectangle", "vehicle.toml"]
    assert sum(path.stat().st_size for path in tmp_path.rglob("*.*")) < 2.6e6
    truths = [json.loads(path.read_text()) for path in sorted(tmp_path.glob("*/truth.json"))]
    assert len({json.dumps(truth["parameters"]) for truth in truths}) == 1
    assert len({truth["seed"] for truth in truths}) == 3
    assert all(300 <= truth["path"]["duration_s"] <= 400 for truth in truths)


@pytest.mark.parametrize("counter_bits", [None, 16])
@pytest.mark.parametrize("convention", ["enu", "ned"])
def test_the_readers_read_it_back(tmp_path, counter_bits, convention):
    settings = SimulationSettings(
        drive=DriveSettings(path="general", duration_s=120.0),
        encoder=EncoderSettings(counter_bits=counter_bits, start_left_ticks=30_000),
        ahrs=AhrsSettings(convention=convention),
        gnss=GnssSettings(with_gst=True, outlier_fraction=0.02),
    )
    simulated = simulate_run(settings)
    write_vehicle_file(settings, tmp_path)
    write_run(simulated, tmp_path / "run")
    (source,) = discover([tmp_path])
    run = read_run(source)
    assert not [notice for notice in run.notices if notice.severity == "warning"]
    assert run.vehicle.convention == convention
    assert not run.wheels.loose[1:].any()
    angle = np.interp(simulated.encoder.true_t_s, simulated.motion.t_s, simulated.wheel_angle_rad.left)
    assert np.max(np.abs(np.ptp(run.wheels.left_rad - angle))) < 2 * np.pi / 32768 + 1e-9
    assert run.heading.yaw_rad == pytest.approx(np.radians(simulated.ahrs.yaw_deg), abs=1e-9)
    assert run.fixes.utc_has_date
    assert run.fixes.utc_s == pytest.approx(simulated.gnss.utc_s, abs=1e-6)
    assert run.fixes.host_t_s == pytest.approx(simulated.gnss.host_t_s, abs=6e-5)
    assert run.fixes.lat_deg == pytest.approx(simulated.gnss.lat_deg, abs=2e-10)
    assert run.fixes.lon_deg == pytest.approx(simulated.gnss.lon_deg, abs=2e-10)
    assert run.fixes.sigma_east_m == pytest.approx(0.01414, abs=1e-4)


def test_a_clock_from_zero_needs_no_unix_time(tmp_path):
    clock = ClockSettings(host_epoch_offset_s=ClockSettings().start_utc_s)
    files = written(tmp_path, replace(SHORT, clock=clock))
    assert files["encoder.csv"].splitlines()[1].startswith(b"0.00")
    assert files["gnss.nmea"].startswith(b"0.0")
