"""Conversion loses nothing that is read: folders into MCAP and back, ROS bags, other people's logs, odd clocks."""

from __future__ import annotations

import contextlib
import io
import json
import sys
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from sccal.cli import main
from sccal.convert.from_folder import nmea_lines
from sccal.convert.paths import convert_paths
from sccal.errors import SccalError
from sccal.logs.options import ReadOptions
from sccal.logs.run import discover, read_run
from sccal.logs.streams import Run
from tests.degrade.logs import NOON, gga, rmc, sentence
from tests.message_logs import messages_of, write_db3, write_ros1
from tests.runs import written

MEASURED = Path(__file__).parents[3] / "shared" / "logs"
VEHICLE = (
    'name = "v"\n[encoder]\nticks_per_rev = 1000\ncounter_bits = 16\n[nominal]\n'
    'wheel_radius_m = 0.08\ntrack_m = 0.7\n[ahrs]\nconvention = "{}"\n'
)
ROWS = 300
T = np.round(100.0 + 0.1 * np.arange(ROWS), 1)


def convert(path: Path, out: Path, form: Any = None, options: ReadOptions | None = None) -> None:
    _, failures = convert_paths([path], out, form, options or ReadOptions(), lambda *_: None)
    if failures:
        raise failures[0].error


def only(path: Path) -> Run:
    (source,) = discover([path])
    return read_run(source)


def assert_same(one: Run, other: Run) -> None:
    """All streams bit by bit."""
    for name in ("wheels", "heading", "fixes"):
        ours, theirs = getattr(one, name), getattr(other, name)
        for field in fields(ours):
            a, b = getattr(ours, field.name), getattr(theirs, field.name)
            if field.name == "extras":
                assert list(a) == list(b)
                for column in a:
                    np.testing.assert_array_equal(a[column], b[column], err_msg=column)
            elif isinstance(a, np.ndarray):
                np.testing.assert_array_equal(a, b, err_msg=f"{name}.{field.name}")
            elif field.name != "source":
                assert a == b or (a is None and b is None), f"{name}.{field.name}"


def texts(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix in (".csv", ".nmea")}


def round_trip(folder: Path, tmp_path: Path) -> tuple[Run, Run, Run]:
    convert(folder, tmp_path / "a")
    convert(tmp_path / "a", tmp_path / "b")
    convert(tmp_path / "b", tmp_path / "c")
    first, second = (next((tmp_path / x).glob("**/*.mcap")).read_bytes() for x in "ac")
    assert first == second
    return only(folder), only(tmp_path / "a"), only(tmp_path / "b")


def rows(header: str, *columns: Any) -> str:
    cells = [[one if isinstance(one, str) else repr(one) for one in np.asarray(c).tolist()] for c in columns]
    return "\n".join([header, *(",".join(row) for row in zip(*cells, strict=True))]) + "\n"


def made(folder: Path, ahrs: str, gnss: str, encoder: str = "", convention: str = "enu", nmea: bool = False) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    ticks = np.round(40.0 * np.arange(ROWS)).astype(int)
    (folder / "encoder.csv").write_text(encoder or rows("t,left_ticks,right_ticks", T, ticks, ticks + 7))
    (folder / "ahrs.csv").write_text(ahrs)
    (folder / ("gnss.nmea" if nmea else "gnss.csv")).write_text(gnss)
    (folder / "vehicle.toml").write_text(VEHICLE.format(convention))
    return folder


YAW = np.round(np.linspace(170, 350, ROWS), 2)
AHRS = rows("t,yaw_deg", T, YAW)
GNSS = rows("t,lat_deg,lon_deg", T, 52 + 1e-6 * np.arange(ROWS), np.full(ROWS, 5.1))


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("simulated") / "run"
    written(folder, "clock.host_epoch_offset_s=0", duration_s=60.0)
    return folder


def test_there_and_back_is_the_same_to_the_byte(simulated: Path, tmp_path: Path) -> None:
    before, there, back = round_trip(simulated, tmp_path)
    assert_same(before, there)
    assert_same(before, back)
    assert texts(simulated) == texts(tmp_path / "b" / "run")
    assert (tmp_path / "a" / "vehicle.toml").read_bytes() == (simulated / "vehicle.toml").read_bytes()


def test_calibrations_agree(tmp_path: Path) -> None:
    folder = written(tmp_path / "run", duration_s=120.0)
    convert(folder, tmp_path / "a")
    one, _ = calibrate_run(only(folder), CalibrationOptions())
    other, _ = calibrate_run(only(tmp_path / "a"), CalibrationOptions())
    assert one.parameters == other.parameters


def test_stock_decoders_read_it(simulated: Path, tmp_path: Path) -> None:
    convert(simulated, tmp_path / "a")
    run = only(simulated)
    with (tmp_path / "a" / "run.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        decoded: dict[str, list[Any]] = {}
        for _, channel, message, value in reader.iter_decoded_messages():
            decoded.setdefault(channel.topic, []).append((message.log_time, value))
        attached = {one.name: one.data for one in reader.iter_attachments()}
        assert [one.name for one in reader.iter_metadata()] == ["sccal.convert"]
    wheels = decoded["/joint_states"]
    assert wheels[0][1].name == ["left_wheel_joint", "right_wheel_joint"]
    np.testing.assert_allclose([m.position[1] for _, m in wheels], run.wheels.right_rad, rtol=1e-12)
    np.testing.assert_allclose([ns * 1e-9 for ns, _ in wheels], run.wheels.t_s, atol=1e-9)
    yaw = [2 * np.arctan2(m.orientation.z, m.orientation.w) for _, m in decoded["/imu/data"]]
    assert np.abs(np.angle(np.exp(1j * (np.array(yaw) - run.heading.yaw_rad)))).max() < 2e-3  # pitch and roll are small
    lines = (simulated / "gnss.nmea").read_text().splitlines()
    assert [m.sentence for _, m in decoded["/nmea_sentence"]] == [line.split(" ", 1)[1] for line in lines]
    stamps = [m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for _, m in decoded["/nmea_sentence"]]
    np.testing.assert_allclose(stamps, [float(line.split(" ")[0]) for line in lines], atol=2e-9)
    assert attached["vehicle.toml"] == (simulated / "vehicle.toml").read_bytes()


@pytest.mark.parametrize("convention", ["enu", "ned"])
def test_angles_sigmas_qualities_and_columns_come_back(tmp_path: Path, convention: str) -> None:
    n = np.arange(ROWS)
    pitch = [f"{x:.1f}" if i % 7 else "" for i, x in enumerate(np.linspace(-20, 20, ROWS))]
    ahrs = rows(
        "t,yaw_deg,pitch_deg,roll_deg,yaw_sigma_deg,gyro_z_dps,current (A)",
        *(T, YAW, pitch, np.round(-0.01 * n, 2), np.full(ROWS, 1.5), np.round(0.3 * n, 1), np.sin(n)),
    )
    quality = np.resize([4, 5, 1, 9, 0], ROWS)
    gnss = rows(
        "t,lat_deg,lon_deg,alt_m,fix_quality,sigma_m,hdop",
        *(T, 52 + 1e-6 * n, np.full(ROWS, 355.1), np.round(3 + 0.1 * n, 1), quality, np.full(ROWS, 0.02), n % 5),
    )
    encoder = rows(
        "t,left_ticks,right_ticks,motor_current_a,t_board", T, 40 * n % 65536, (330 * n) % 65536, np.cos(n), n / 3
    )
    folder = made(tmp_path / "run", ahrs, gnss, encoder, convention)
    before, there, back = round_trip(folder, tmp_path)
    assert "motor_current_a" in there.wheels.extras
    assert set(there.fixes.quality.tolist()) == {4, 5, 1, 9}
    assert np.isnan(there.heading.pitch_rad).any()
    assert_same(before, there)
    assert_same(before, back)


def test_signs_for_others_to_read(tmp_path: Path) -> None:
    """A compass heading of 30 degrees, nose up, left side up, as ROS has it: 60 from east, pitch minus, roll plus."""
    still = np.zeros(ROWS)
    ahrs = rows("t,yaw_deg,pitch_deg,roll_deg", T, still + 30, still + 10, still + 5)
    convert(made(tmp_path / "run", ahrs, GNSS, convention="ned"), tmp_path / "a")
    with (tmp_path / "a" / "run.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        q = next(m for *_, m in reader.iter_decoded_messages(topics=["/imu/data"])).orientation
    from scipy.spatial.transform import Rotation

    np.testing.assert_allclose(Rotation.from_quat([q.x, q.y, q.z, q.w]).as_euler("ZYX", degrees=True), [60, -10, 5])


@pytest.mark.parametrize("start", [-1000.0, 0.0, 1.7e9])
def test_any_zero_of_the_clock(tmp_path: Path, start: float) -> None:
    t = np.round(start + 0.1 * np.arange(ROWS), 1)
    ticks = 40 * np.arange(ROWS)
    encoder = rows("t,left_ticks,right_ticks,amps", t, ticks, ticks, np.sin(ticks))
    gnss = rows("t,lat_deg,lon_deg", t, 52 + 1e-6 * ticks, np.full(ROWS, -5.1))
    folder = made(tmp_path / "run", rows("t,yaw_rad", t, np.linspace(-3, 3, ROWS)), gnss, encoder)
    before, there, back = round_trip(folder, tmp_path)
    np.testing.assert_allclose(there.heading.yaw_rad, before.heading.yaw_rad, atol=1e-14)
    np.testing.assert_array_equal(there.wheels.t_s, before.wheels.t_s)
    np.testing.assert_array_equal(there.wheels.extras["amps"], before.wheels.extras["amps"])
    assert_same(there, back)


def test_times_beyond_ros_are_told(tmp_path: Path) -> None:
    t = 1.7e10 + 100.0 * np.arange(ROWS)
    folder = made(
        tmp_path / "run",
        rows("t,yaw_deg", t, YAW),
        rows("t,lat_deg,lon_deg", t, 52 + 1e-6 * np.arange(ROWS), np.full(ROWS, 5.0)),
        rows("t,left_ticks,right_ticks", t, np.arange(ROWS), np.arange(ROWS)),
    )
    with pytest.raises(SccalError, match="more than ROS messages can hold"):
        convert(folder, tmp_path / "a")
    assert not list((tmp_path / "a").glob("**/*.mcap"))


@pytest.mark.parametrize("dated", [True, False])
def test_sentences_without_receive_times_get_none(simulated: Path, tmp_path: Path, dated: bool) -> None:
    folder = tmp_path / "run"
    written(folder, "gnss.with_host_time=false", "clock.host_epoch_offset_s=0", duration_s=60.0)
    lines = (folder / "gnss.nmea").read_text().splitlines()
    if not dated:
        lines = [line for line in lines if "GGA" in line]
    (folder / "gnss.nmea").write_text("\n".join(lines) + "\n")
    before, there, back = round_trip(folder, tmp_path)
    assert np.isnan(there.fixes.host_t_s).all()
    assert_same(before, there)
    assert_same(before, back)
    with (tmp_path / "a" / "run.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        shown = [(one.log_time, m) for _, _, one, m in reader.iter_decoded_messages(topics=["/nmea_sentence"])]
    assert all(m.header.stamp.sec == m.header.stamp.nanosec == 0 for _, m in shown)
    assert abs(shown[0][0] * 1e-9 - before.wheels.t_s[0]) < 5


def test_what_other_sentences_count_is_no_time_of_day() -> None:
    """The first field of GSV is a number of messages; in the evening, 3 s after midnight would be the next day."""
    start_s = 1717243200.0 + 6 * 3600.0
    lines = []
    for second in range(40):
        lines += [gga(NOON + 6 * 3600.0 + second, 52.1, 5.3), rmc(NOON + 6 * 3600.0 + second, 52.1, 5.3)]
        lines += [sentence("GPGSV,3,1,11,01,45,100,40")]
    raw = ("\n".join(lines) + "\n").encode()
    found = nmea_lines(raw, start_s + np.arange(40.0), Path("gnss.nmea"), [])
    np.testing.assert_allclose(found.shown_s, start_s + np.repeat(np.arange(40.0), 3), atol=1e-6)


def test_what_repair_and_notices_need_is_kept(tmp_path: Path) -> None:
    """A reset, a bogus row, a swap and a gap are met again; a sentence cut in the middle stays cut."""
    n = np.arange(ROWS)
    left = np.where(n < 150, 400 * n, 400 * (n - 150))
    left[60] += 20000
    t = T.copy()
    t[200:] += 3
    encoder = rows("t,left_ticks,right_ticks", t, left, 400 * n)
    folder = made(tmp_path / "run", rows("t,yaw_deg", t, YAW), GNSS, encoder)
    before, there, back = round_trip(folder, tmp_path)
    assert before.wheels.loose.any()
    assert_same(before, there)
    assert_same(before, back)
    assert [n.what for n in before.notices if n.source == "encoder.csv"] == [
        n.what for n in there.notices if "joint_states" in n.source
    ]


def test_broken_sentences_stay_as_broken_as_they_were(simulated: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    for path in simulated.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    lines = (folder / "gnss.nmea").read_bytes().splitlines(keepends=True)
    lines[10] = lines[10][:40] + lines[11].split(b" ", 1)[1]
    lines[20] = lines[20].replace(b"*", b"9*")
    lines[30] = b"\xb5\x62\x01\x07$\xff\x00" + lines[30]
    lines[40] = lines[40].split(b" ", 1)[1]
    lines[-1] = lines[-1][:50]
    (folder / "gnss.nmea").write_bytes(b"".join(lines))
    before, there, back = round_trip(folder, tmp_path)
    assert_same(before, there)
    assert_same(there, back)


def test_a_run_without_ahrs_keeps_the_receivers_heading(simulated: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    from sccal.logs.write import checksum

    lines = []
    for line in (simulated / "gnss.nmea").read_text().splitlines():
        lines.append(line)
        if "GGA" in line:
            t = line.split(" ", 1)[0]
            heading = f"GNTHS,{(float(t) * 3) % 360:.2f},A"
            lines.append(f"{float(t) + 0.002:.4f} ${heading}*{checksum(heading)}")
    (folder / "gnss.nmea").write_text("\n".join(lines) + "\n")
    for name in ("encoder.csv", "vehicle.toml"):
        (folder / name).write_bytes((simulated / name).read_bytes())
    before, there, back = round_trip(folder, tmp_path)
    assert_same(before, there)
    assert_same(before, back)
    assert not (tmp_path / "b" / "run" / "ahrs.csv").exists()


def test_bags_and_other_logs(simulated: Path, tmp_path: Path) -> None:
    run, nmea = only(simulated), (simulated / "gnss.nmea").read_bytes()
    for name, lines in (("nmea", nmea), ("fixes", None)):
        (tmp_path / name).mkdir()
        write_db3(messages_of(run, lines), tmp_path / name / "drive")
        (tmp_path / name / "vehicle.toml").write_bytes((simulated / "vehicle.toml").read_bytes())
        before = only(tmp_path / name)
        for form, out in (("mcap", "m"), ("folder", "f")):
            convert(tmp_path / name, tmp_path / name / ".." / f"{name}-{out}", form)
            after = only(tmp_path / f"{name}-{out}")
            for stream, quantities in (
                ("wheels", ("t_s", "left_rad", "right_rad", "loose")),
                ("heading", ("t_s", "yaw_rad", "pitch_rad", "roll_rad")),
                ("fixes", ("host_t_s", "lat_deg", "lon_deg", "alt_m", "quality", "sigma_east_m", "utc_s")),
            ):
                for quantity in quantities:
                    a, b = (getattr(getattr(one, stream), quantity) for one in (before, after))
                    np.testing.assert_allclose(a, b, rtol=1e-15, atol=1e-14, err_msg=f"{name} {form} {quantity}")


def test_ros1_bags_become_mcap(simulated: Path, tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    write_ros1(messages_of(only(simulated), None)[:90], tmp_path / "in" / "drive.bag")
    (tmp_path / "in" / "vehicle.toml").write_bytes((simulated / "vehicle.toml").read_bytes())
    convert(tmp_path / "in", tmp_path / "out")
    assert (tmp_path / "out" / "drive.mcap").is_file()
    np.testing.assert_array_equal(only(tmp_path / "in").wheels.left_rad, only(tmp_path / "out").wheels.left_rad)


def test_layout_and_vehicles(tmp_path: Path) -> None:
    """Each run finds its own vehicle again, whether it stood beside, above, or was one of two that differ."""
    logs = tmp_path / "logs"
    for name in ("a/one", "a/two", "b/three"):
        made(logs / name, AHRS, GNSS)
    (logs / "a/two/vehicle.toml").write_text(VEHICLE.format("ned"))
    (logs / "b/vehicle.toml").write_bytes((logs / "b/three/vehicle.toml").read_bytes())
    (logs / "b/three/vehicle.toml").unlink()
    convert(logs, tmp_path / "out")
    convert(tmp_path / "out", tmp_path / "back")
    for folder in (tmp_path / "out", tmp_path / "back"):
        found = {one.name.replace("two/two", "two"): read_run(one).vehicle.convention for one in discover([folder])}
        assert found == {"a/one": "enu", "a/two": "ned", "b/three": "enu"}


def test_one_bad_run_does_not_stop_the_others(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made(tmp_path / "logs" / "good", AHRS, GNSS)
    made(tmp_path / "logs" / "bad", "t,nothing\n1,2\n", GNSS)
    code, shown, told = command("convert", tmp_path / "logs", "--out", tmp_path / "out")
    assert (code, "bad: not written" in shown, "ahrs.csv" in told) == (3, True, True)
    assert {path.name for path in (tmp_path / "out").rglob("*.mcap")} == {"good.mcap"}


def test_nothing_of_others_is_overwritten(tmp_path: Path) -> None:
    folder = made(tmp_path / "logs" / "run", AHRS, GNSS)
    for out in (tmp_path / "logs", folder, tmp_path):
        assert command("convert", tmp_path / "logs", "--out", out)[0] == 2
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "run.mcap").write_bytes(b"mine")
    assert command("convert", tmp_path / "logs", "--out", tmp_path / "out")[0] == 2
    assert (tmp_path / "out" / "run.mcap").read_bytes() == b"mine"
    (tmp_path / "out" / "run.mcap").unlink()
    for _ in range(2):
        assert command("convert", tmp_path / "logs", "--out", tmp_path / "out")[0] == 0
    log = tmp_path / "out" / "run.mcap"
    before = log.read_bytes()
    assert command("convert", log, "--to", "mcap", "--out", tmp_path / "out")[0] == 2
    assert command("convert", log, "--to", "elsewhere", "--out", tmp_path / "out")[0] == 2
    assert log.read_bytes() == before
    for _ in range(2):
        assert command("convert", log, "--out", tmp_path / "out")[0] == 0
    assert json.loads((tmp_path / "out" / "run" / "convert.json").read_text())["schema"] == "sccal.convert/1"
    (tmp_path / "out" / "run" / "convert.json").unlink()
    assert command("convert", log, "--out", tmp_path / "out")[0] == 2
    assert not list(tmp_path.rglob(".*"))


def command(*arguments: object) -> tuple[int, str, str]:
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        patch.setattr(sys, "argv", ["sccal", *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            main()
    return int(caught.value.code or 0), out.getvalue(), err.getvalue()


@pytest.mark.measured
@pytest.mark.skipif(not MEASURED.is_dir(), reason="no measured logs beside the checkout")
def test_measured_runs_come_back(tmp_path: Path) -> None:
    for source in discover([MEASURED]):
        out = tmp_path / source.name
        convert_paths([source.path], out / "a", "mcap", ReadOptions(), lambda *_: None)
        convert_paths([out / "a"], out / "b", "folder", ReadOptions(), lambda *_: None)
        before = read_run(source)
        assert_same(before, only(out / "a"))
        assert_same(before, only(out / "b"))
