"""Further cases of receivers and messages: other makers' headings and positions, bags, and types of messages."""

from __future__ import annotations

import bz2
import gzip
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from studies.arrays import stream
from studies.earth import clock_text, rmc, sentence
from studies.field.bags import (
    Message,
    Told,
    header,
    in_order,
    messages,
    nothing,
    quaternion,
    vector,
    write_db3,
    write_mcap,
    write_metadata,
    write_ros1,
)
from studies.field.files import (
    epochs,
    heading_of,
    nmea_lines,
    resaid,
    stamped,
    utc,
    without_fixes,
    write_encoder,
    write_lines,
    write_run,
    write_vehicle,
)
from studies.field.further_robots import Bend, Drawn, case_of
from studies.field.known_messages import Odometer, nav_pvt_of
from studies.field.known_sentences import POS_REST, crc32, gpsd_reports, week
from studies.field.wanted import ANY_LEVEL, Chapter, Truth, inspected, refused, right
from studies.field.world import START_S, Instruments, Log

HEADINGS = Chapter("further", "headings of makers")
SENTENCES = Chapter("further", "sentences")
FILES = Chapter("further", "other files")
TYPES = Chapter("further", "messages")
BAGS = Chapter("further", "bags")
CHAPTERS = (HEADINGS, SENTENCES, FILES, TYPES, BAGS)

Form = Callable[[float, float], str]
"""A heading sentence of a UTC and a heading, clockwise from true north."""


def antennas(drawn: Drawn) -> Instruments:
    """Headings of two antennas instead of an AHRS, mounted at a drawn angle."""
    return replace(drawn.told, offset_deg=float(drawn.rng.choice([0.0, 90.0, -90.0, 180.0])), yaw_slow=(0.2, 30.0))


def said_heading(form: Form) -> Bend:
    """No ahrs.csv; a heading with each fix."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log(told=antennas(drawn))
        write_vehicle(folder, log)
        write_encoder(folder, log)
        headings = heading_of(log)
        lines = nmea_lines(log, lambda number, utc_s: [form(utc_s, float(headings[number]))])
        write_lines(folder / "gnss.nmea", stamped(lines))
        return Truth.of(log)

    return bend


def long_heading(name: str, rest: str) -> Form:
    """The long ASCII message of a heading, with the receiver's status in its header."""

    def form(utc_s: float, heading: float) -> str:
        number, of_week = week(utc_s)
        return crc32(
            f"{name},COM2,0,61.5,FINESTEERING,{number},{of_week:.3f},02000000,0000,16248;"
            f"SOL_COMPUTED,NARROW_INT,0.9511,{heading:.6f},-0.713,0.0,0.1510,0.2230,{rest}"
        )

    return form


def quectel(utc_s: float, heading: float) -> str:
    """Version, time, quality, nothing, length, pitch, roll, heading, their errors, satellites."""
    return sentence(f"PQTMTAR,1,{clock_text(utc_s)}0,4,,0.752,-0.412000,0.000000,{heading:.6f},0.21,0.0,0.16,24")


def hpr_of_satellite(utc_s: float, heading: float) -> str:
    """Time, heading, pitch, roll, kind."""
    return sentence(f"PSAT,HPR,{clock_text(utc_s)},{heading:.2f},-0.41,,N")


def tra(utc_s: float, heading: float) -> str:
    """Time, heading, pitch, roll, quality, satellites, age, station."""
    return sentence(f"GPTRA,{clock_text(utc_s)},{heading:.2f},-0.41,0.00,4,23,0.00,0000")


def seapath(utc_s: float, heading: float) -> str:
    """Roll, pitch, heading, heave; no time."""
    return sentence(f"PSXN,23,0.12,-0.41,{heading:.2f},0.00")


def magnetic(utc_s: float, heading: float) -> str:
    """A compass's heading; variation and deviation are empty."""
    return sentence(f"HCHDG,{heading:.1f},,,,")


def plain_magnetic(utc_s: float, heading: float) -> str:
    """A magnetic heading."""
    return sentence(f"HCHDM,{heading:.1f},M")


for number, (name, form) in enumerate(
    (
        ("heading-psat-hpr", hpr_of_satellite),
        ("heading-headinga", long_heading("HEADINGA", '"0004",15,15,15,15,0,01,0,33')),
        ("heading-heading2a", long_heading("HEADING2A", '"R222","AAAA",18,17,17,16,0,01,0,33')),
        ("heading-pqtmtar", quectel),
        ("heading-gptra", tra),
        ("heading-psxn-23", seapath),
        ("heading-hdg", magnetic),
        ("heading-hdm", plain_magnetic),
    )
):
    HEADINGS.add(name, case_of(4000 + number, said_heading(form)), right(3.0))
HEADINGS.add(
    "heading-only-course",
    case_of(4010, said_heading(lambda utc_s, heading: sentence(f"GNVTG,{heading:.2f},T,,M,1.555,N,2.880,K,D"))),
    refused(r"(course|VTG)"),
)
HEADINGS.add(
    "heading-unread-listed",
    case_of(4011, said_heading(lambda utc_s, heading: sentence(f"PXYZW,ATT,{clock_text(utc_s)},{heading:.3f}"))),
    refused(r"PXYZ"),
)


def lines_changed(change: Callable[[Drawn, Log], list[str]]) -> Bend:
    """The plain folder with other lines."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log()
        write_run(folder, log)
        write_lines(folder / "gnss.nmea", change(drawn, log))
        return Truth.of(log)

    return bend


def shortened(count: int) -> Callable[[Drawn, Log], list[str]]:
    """GGA that ends after so many fields."""
    return lambda drawn, log: stamped(
        [(t, resaid(text, lambda fields: fields[:count])) for t, text in nmea_lines(log) if "GGA" in text]
    )


SENTENCES.add("gga-9-fields", case_of(4100, lines_changed(shortened(9))), right(2.0))
SENTENCES.add("gga-7-fields", case_of(4101, lines_changed(shortened(7))), right(2.0))


def cut_lines(drawn: Drawn, log: Log) -> list[str]:
    """One line in eight ends early, without its checksum."""
    rng = stream(drawn.seed, "cut")
    kept = []
    for line in stamped(nmea_lines(log)):
        at = int(rng.integers(40, len(line) - 6)) if rng.random() < 0.125 else len(line)
        kept.append(line[:at])
    return kept


SENTENCES.add("sentences-cut", case_of(4102, lines_changed(cut_lines)), right(2.5))


def hdt_digits_lost(drawn: Drawn, folder: Path) -> Truth:
    """A serial port that loses the tail of every seventh heading sentence."""
    log = drawn.log(told=antennas(drawn))
    write_vehicle(folder, log)
    write_encoder(folder, log)
    headings, rng = heading_of(log), stream(drawn.seed, "lost tails")

    def hdt(number: int, _utc_s: float) -> list[str]:
        text = sentence(f"GNHDT,{headings[number]:.4f},T")
        return [text[: int(rng.integers(9, 13))] if rng.random() < 0.14 else text]

    write_lines(folder / "gnss.nmea", stamped(nmea_lines(log, hdt)))
    return Truth.of(log)


SENTENCES.add("hdt-tails-lost", case_of(4103, hdt_digits_lost), right(3.0))


def ggk(drawn: Drawn, log: Log) -> list[str]:
    """Positions in a maker's own sentence with the date, and a code of its own: 3 is fixed."""
    lines = []
    for _, utc_s, received_s, place in epochs(log):
        date = utc(utc_s).strftime("%m%d%y")
        said = sentence(f"PTNL,GGK,{clock_text(utc_s)},{date},{place},3,12,1.6,EHT496.123,M")
        lines.append(f"{received_s:.4f} {said}")
    return lines


def best_position(drawn: Drawn, log: Log) -> list[str]:
    """Positions in a long ASCII message, with a type of solution as words and three sigmas."""
    latitudes, longitudes = log.places
    lines = []
    for number, utc_s, received_s, _ in epochs(log):
        weeks, of_week = week(utc_s)
        said = crc32(
            f"BESTPOSA,COM1,0,72.0,FINESTEERING,{weeks},{of_week:.3f},02000020,cdba,16248;SOL_COMPUTED,NARROW_INT,"
            f"{latitudes[number]:.11f},{longitudes[number]:.11f},450.1230,46.1000,WGS84,0.0121,0.0118,0.0246,"
            '"0004",1.000,0.000,21,19,19,17,0,06,39,33'
        )
        lines.append(f"{received_s:.4f} {said}")
    return lines


def ublox_own(drawn: Drawn, log: Log) -> list[str]:
    """Positions in a maker's sentence with words for the quality."""
    lines = []
    for _, utc_s, received_s, place in epochs(log):
        said = sentence(
            f"PUBX,00,{clock_text(utc_s)},{place},496.123,RK,0.014,0.021,0.512,0.00,0.010,1.0,0.71,0.99,0.66,21,0,0"
        )
        lines.append(f"{received_s:.4f} {said}")
    return lines


SENTENCES.add("positions-ggk", case_of(4104, lines_changed(ggk)), right(2.0), refused(r"GGK"))
SENTENCES.add("positions-bestposa", case_of(4105, lines_changed(best_position)), right(2.0), refused(r"BESTPOS"))
SENTENCES.add("positions-pubx", case_of(4106, lines_changed(ublox_own)), right(2.0), refused(r"PUBX"))
SENTENCES.add(
    "positions-rmc-only",
    case_of(
        4107,
        lines_changed(lambda d, log: [f"{t:.4f} {rmc(u, place, 4)}" for _, u, t, place in epochs(log)]),
    ),
    right(3.0, ANY_LEVEL),
)


def pos_sexagesimal(drawn: Drawn, folder: Path) -> Truth:
    """A post-processor's file in UTC, with degrees, minutes and seconds in columns of their own."""
    log = drawn.log()
    without_fixes(folder, log)
    lines = [f"%  UTC   latitude(d'\") longitude(d'\") {POS_REST}"]
    latitudes, longitudes = log.places
    for t, lat, lon in zip(log.fix_t.tolist(), latitudes.tolist(), longitudes.tolist(), strict=True):
        when = utc(round(START_S + t, 3)).strftime("%Y/%m/%d %H:%M:%S.%f")[:-3]
        lines.append(
            f"{when} {sexagesimal(lat)} {sexagesimal(lon)}   450.1230   1  15   0.0120   0.0110   0.0240"
            "   0.0010   0.0000   0.0000   1.00   31.0"
        )
    write_lines(folder / "gnss.pos", lines)
    return Truth.of(log)


def sexagesimal(angle_deg: float) -> str:
    """Degrees, minutes and seconds apart."""
    whole, rest = divmod(angle_deg, 1.0)
    minutes, rest = divmod(rest * 60.0, 1.0)
    return f"{int(whole):4d} {int(minutes):02d} {rest * 60.0:08.5f}"


FILES.add("file-pos-sexagesimal", case_of(4200, pos_sexagesimal), right(2.0), refused(r"\.pos\b"))


def pos_week(drawn: Drawn, folder: Path) -> Truth:
    """The same with week and seconds, under the name that the receiver's logger gave it."""
    log = drawn.log()
    without_fixes(folder, log)
    lines = [f"%  GPST   latitude(deg) longitude(deg) {POS_REST}"]
    latitudes, longitudes = log.places
    for t, lat, lon in zip(log.fix_t.tolist(), latitudes.tolist(), longitudes.tolist(), strict=True):
        number, of_week = week(START_S + t)
        lines.append(
            f"{number} {of_week:10.3f} {lat:14.9f} {lon:14.9f}   450.1230   1  15   0.0120   0.0110   0.0240"
            "   0.0010   0.0000   0.0000   1.00   31.0"
        )
    write_lines(folder / "rover_20240601.pos", lines)
    return Truth.of(log)


FILES.add("file-pos-week", case_of(4201, pos_week), right(2.0), refused(r"rover_20240601\.pos"))


def gpsd_file(drawn: Drawn, folder: Path) -> Truth:
    """The daemon's stream with its other reports, under its own name."""
    log = drawn.log()
    without_fixes(folder, log)
    lines = [json.dumps({"class": "VERSION", "release": "3.25", "proto_major": 3})]
    for number, report in enumerate(gpsd_reports(log)):
        if number % 5 == 0:
            lines.append(json.dumps({"class": "SKY", "device": "/dev/ttyUSB0", "nSat": 24, "uSat": 17}))
        lines.append(json.dumps(report))
    write_lines(folder / "gpsd.json", lines)
    return Truth.of(log)


FILES.add("file-gpsd", case_of(4202, gpsd_file), right(2.0), refused(r"gpsd\.json"))


def one_mcap(found: Callable[[Drawn, Log], list[Message]], **settings: Any) -> Bend:
    """One MCAP file."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log()
        write_vehicle(folder, log)
        write_mcap(folder / "run.mcap", found(drawn, log), **settings)
        return Truth.of(log)

    return bend


def strings_with_headings(drawn: Drawn, folder: Path) -> Truth:
    """Sentences as strings, headings among them, and no AHRS."""
    log = drawn.log(told=antennas(drawn))
    write_vehicle(folder, log)
    headings = heading_of(log)
    lines = nmea_lines(log, lambda number, _: [sentence(f"GNTHS,{headings[number]:.3f},A")])
    told = [(round(t * 1e9), "/um982/nmea", "std_msgs/msg/String", {"data": text}) for t, text in lines]
    write_mcap(folder / "run.mcap", in_order(messages(log, heading=nothing, fix=nothing), told))
    return Truth.of(log)


TYPES.add("message-strings-headings", case_of(4300, strings_with_headings), right(3.0))


def nav_pvt(_number: int, ns: int, lat: float, lon: float) -> Told:
    """A receiver's own message, under another topic."""
    return nav_pvt_of("/rover/navpvt", ns, lat, lon)


TYPES.add(
    "message-navpvt-alone",
    case_of(4301, one_mcap(lambda drawn, log: messages(log, fix=nav_pvt))),
    right(2.5),
    refused(r"NavPVT"),
    asked=(inspected(r"navpvt"),),
)


def motion_capture(drawn: Drawn, log: Log) -> list[Message]:
    """Poses of a camera system in metres, and no receiver: they hold position and heading."""
    heading = np.radians(np.interp(log.received_t, log.yaw_t, log.yaw_deg)).tolist()
    poses = []
    places = zip((log.received_t - 0.02).tolist(), log.east_m.tolist(), log.north_m.tolist(), heading, strict=True)
    for t, east, north, yaw in places:
        ns = round((START_S + t) * 1e4) * 100_000
        pose = {"position": vector(east, north, 0.2), "orientation": quaternion(yaw)}
        poses.append((ns, "/mocap/base/pose", "geometry_msgs/msg/PoseStamped", {"header": header(ns), "pose": pose}))
    return in_order(messages(log, heading=nothing, fix=nothing), poses)


TYPES.add(
    "message-pose-stamped",
    case_of(4302, one_mcap(motion_capture)),
    right(3.0),
    refused(r"PoseStamped"),
    asked=(inspected(r"PoseStamped|/mocap/base/pose"),),
)


def twists() -> Callable[[int, int, float, float], Told]:
    """Speed and turn rate as the nominal robot has them."""
    last: list[tuple[int, float, float]] = []

    def wheels(number: int, ns: int, left_rad: float, right_rad: float) -> Told:
        told: Told = []
        if last:
            before_ns, before_left, before_right = last.pop()
            step_s = (ns - before_ns) * 1e-9
            left, right_ = ((left_rad - before_left) / step_s, (right_rad - before_right) / step_s)
            values = {
                "header": header((ns + before_ns) // 2),
                "twist": {
                    "linear": vector(0.5 * (left + right_) * TWIST_RADIUS_M),
                    "angular": vector(z=(right_ - left) * TWIST_RADIUS_M / TWIST_TRACK_M),
                },
            }
            told = [("/base/velocity", "geometry_msgs/msg/TwistStamped", values)]
        last.append((ns, left_rad, right_rad))
        return told

    return wheels


TWIST_RADIUS_M, TWIST_TRACK_M = 0.1, 0.6


def twist_robot(drawn: Drawn, folder: Path) -> Truth:
    """A base that publishes its velocity and no wheels."""
    robot = replace(
        drawn.robot,
        nominal_radius_m=TWIST_RADIUS_M,
        nominal_track_m=TWIST_TRACK_M,
        radius_right_m=TWIST_RADIUS_M * 1.011,
        radius_left_m=TWIST_RADIUS_M * 0.994,
        track_m=TWIST_TRACK_M * 1.04,
    )
    log = replace(drawn, robot=robot, told=replace(drawn.told, encoder_hz=50.0)).log()
    write_vehicle(folder, log)
    write_mcap(folder / "run.mcap", messages(log, wheels=twists()))
    return Truth.of(log)


TYPES.add("message-twist-stamped", case_of(4303, twist_robot), right(4.0, ANY_LEVEL), refused(r"TwistStamped"))


def odometry_of_pose(drawn: Drawn, folder: Path) -> Truth:
    """Odometry whose twist is not filled in, its pose by the nominal robot."""
    log = drawn.log()
    odometer = Odometer(log.robot.nominal_radius_m, log.robot.nominal_track_m)

    def wheels(_number: int, ns: int, left_rad: float, right_rad: float) -> Told:
        x, y, yaw = odometer.pose(left_rad, right_rad)
        values = {
            "header": header(ns, "odom"),
            "child_frame_id": "base_footprint",
            "pose": {"pose": {"position": vector(x, y), "orientation": quaternion(yaw)}, "covariance": [0.0] * 36},
            "twist": {"twist": {"linear": vector(), "angular": vector()}, "covariance": [0.0] * 36},
        }
        return [("/wheel/odom", "nav_msgs/msg/Odometry", values)]

    write_vehicle(folder, log)
    write_mcap(folder / "run.mcap", messages(log, wheels=wheels))
    return Truth.of(log)


TYPES.add("message-odometry-of-pose", case_of(4304, odometry_of_pose), right(4.0, ANY_LEVEL))


def shown_without_vehicle(write: Callable[[Path, list[Message]], None], leave_out: str = "") -> Bend:
    """A bag of which a stream is missing, or the declaration."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log()
        folder.mkdir(parents=True)
        found = [message for message in messages(log) if not leave_out or message[1] != leave_out]
        if leave_out:
            write_vehicle(folder, log)
        write(folder, found)
        return Truth.of(log)

    return bend


NO_VEHICLE = refused(r"vehicle\.toml")
SHOWN = (inspected(r"JointState|wheels", r"Imu|heading", r"fixes", exits=(0,)),)
for number, (name, write) in enumerate(
    (
        ("inspect-mcap-alone", lambda folder, found: write_mcap(folder / "drive.mcap", found)),
        ("inspect-bag-alone", lambda folder, found: write_ros1(folder / "drive.bag", found)),
        ("inspect-db3-alone", lambda folder, found: write_db3(folder / "drive", found)),
    )
):
    BAGS.add(name, case_of(4400 + number, shown_without_vehicle(write)), NO_VEHICLE, asked=SHOWN)
BAGS.add(
    "inspect-mcap-no-fixes",
    case_of(4403, shown_without_vehicle(lambda folder, found: write_mcap(folder / "drive.mcap", found), "/fix")),
    refused(r"fix"),
    asked=(inspected(r"wheels|JointState", r"heading|Imu", exits=(0,)),),
)
BAGS.add(
    "inspect-db3-no-wheels",
    case_of(4404, shown_without_vehicle(lambda folder, found: write_db3(folder / "drive", found), "/joint_states")),
    refused(r"wheel"),
    asked=(inspected(r"fixes|NavSatFix", exits=(0,)),),
)


def bag(write: Callable[[Drawn, Path, list[Message]], None]) -> Bend:
    """A bag beside its declaration."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log()
        write_vehicle(folder, log)
        write(drawn, folder, messages(log))
        return Truth.of(log)

    return bend


def chunks(found: list[Message], count: int) -> list[list[Message]]:
    """The messages in so many parts."""
    size = len(found) // count + 1
    return [found[begin : begin + size] for begin in range(0, len(found), size)]


def write_mcap_parts(drawn: Drawn, folder: Path, found: list[Message]) -> None:
    """A drawn number of parts."""
    parts = chunks(found, int(drawn.rng.integers(12, 20)))
    names = [f"night_run_{number}.mcap" for number in range(len(parts))]
    for name, part in zip(names, parts, strict=True):
        write_mcap(folder / "night_run" / name, part)
    write_metadata(folder / "night_run", names)


def write_bag_parts(drawn: Drawn, folder: Path, found: list[Message]) -> None:
    """Parts as the older recorder names them."""
    for number, part in enumerate(chunks(found, 3)):
        write_ros1(folder / f"drive_2024-06-01-14-0{number}-00_{number}.bag", part)


def squeezed(suffix: str, squeeze: Callable[[bytes], bytes]) -> Callable[[Drawn, Path, list[Message]], None]:
    """One MCAP, compressed by a common tool."""

    def write(drawn: Drawn, folder: Path, found: list[Message]) -> None:
        write_mcap(folder / "drive.mcap", found)
        (folder / f"drive.mcap.{suffix}").write_bytes(squeeze((folder / "drive.mcap").read_bytes()))
        (folder / "drive.mcap").unlink()

    return write


def write_bz2_bag(drawn: Drawn, folder: Path, found: list[Message]) -> None:
    """A ROS 1 bag with compressed chunks."""
    from rosbags.rosbag1 import Writer

    write_ros1(folder / "drive.bag", found, compression=Writer.CompressionFormat.BZ2)


def write_unindexed(drawn: Drawn, folder: Path, found: list[Message]) -> None:
    """A ROS 1 bag that was not closed: its index is missing and its header says so."""
    write_ros1(folder / "whole", found)
    raw = bytearray((folder / "whole").read_bytes())
    (folder / "whole").unlink()
    at = raw.index(b"index_pos=") + len(b"index_pos=")
    end = int.from_bytes(raw[at : at + 8], "little")
    raw[at : at + 8] = bytes(8)
    (folder / "drive.bag").write_bytes(bytes(raw[:end]))


def write_no_summary(drawn: Drawn, folder: Path, found: list[Message]) -> None:
    """An MCAP without its summary and end, as after a power cut at the very end."""
    write_mcap(folder / "drive.mcap", found, chunk_size=32 * 1024)
    raw = (folder / "drive.mcap").read_bytes()
    (folder / "drive.mcap").write_bytes(raw[: int(len(raw) * float(drawn.rng.uniform(0.9, 0.95)))])


BAGS.add("bag-mcap-many-parts", case_of(4410, bag(write_mcap_parts)), right(2.0, runs=1))
BAGS.add("bag-ros1-parts", case_of(4411, bag(write_bag_parts)), right(2.0, runs=1))
BAGS.add(
    "bag-mcap-gz",
    case_of(4412, bag(squeezed("gz", lambda raw: gzip.compress(raw, 1)))),
    right(2.0),
    refused(r"(gunzip|\.gz\b|gzip)"),
)
BAGS.add(
    "bag-mcap-bz2",
    case_of(4413, bag(squeezed("bz2", lambda raw: bz2.compress(raw, 1)))),
    right(2.0),
    refused(r"(bunzip2|\.bz2\b)"),
)
BAGS.add("bag-ros1-bz2-chunks", case_of(4414, bag(write_bz2_bag)), right(2.0))
BAGS.add(
    "bag-ros1-unindexed",
    case_of(4415, bag(write_unindexed)),
    right(2.0, ANY_LEVEL),
    refused(r"(reindex|not closed|unindexed)"),
)
BAGS.add("bag-mcap-no-summary", case_of(4416, bag(write_no_summary)), right(3.0, ANY_LEVEL), refused(r"mcap recover"))
