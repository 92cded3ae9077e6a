"""Valid samples to start from: one short simulated drive in every format that is read."""

from __future__ import annotations

import sqlite3
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from sccal.logs.nmea import parse_nmea
from sccal.logs.run import discover, read_run
from sccal.simulate.choose import settings_from
from sccal.simulate.files import write_run, write_vehicle_file
from sccal.simulate.run import simulate_run
from tests import message_logs

_SETTINGS = ("drive.path=general", "drive.duration_s=30", "encoder.rate_hz=20", "ahrs.rate_hz=10", "gnss.rate_hz=2")
_SHORT_LINES = 12
_SHORT_S = 1.5
_HEADINGS = (
    b"$GNRMC,%s,A,4717.1,N,00833.9,E,0.5,0,010624,,,R",
    b"$GNGGA,%s,4717.11,N,00833.91,E,4,12,0.8,408.0,M,47.0,M,1.0,0000",
    b"$GNGNS,%s,4717.11,N,00833.91,E,RR,12,0.8,408.0,47.0,1.0,0000",
    b"$GNZDA,%s,01,06,2024,00,00",
    b"$GNGST,%s,0.1,0.02,0.01,45,0.01,0.02,0.03",
    b"$GNVTG,10,T,,M,0.5,N,0.9,K,R",
    b"$GNHDT,123.4,T",
    b"$GNTHS,123.4,A",
    b"$PASHR,%s,123.4,T,1.0,-2.0,0.1,0.1,0.1,0.2,4,0",
    b"$PTNL,AVR,%s,+123.4,Yaw,+1.0,Tilt,,,1.2,3,1.1,12",
    b"$PTNL,GGK,%s,060124,4717.11,N,00833.91,E,3,12,1.1,EHT455.0,M",
    b"$KSXT,20240601%s,8.5651,47.2851,455.0,123.4,1.0,90.0,0.9,,3,3,12,12,,,,1.0,2.0",
)


def with_checksum(sentence: bytes) -> bytes:
    """A sentence from its ``$`` on with the checksum of what is there."""
    body = sentence.split(b"*")[0]
    total = 0
    for byte in body[1:]:
        total ^= byte
    return b"%s*%02X" % (body, total)


@cache
def run_files() -> dict[str, bytes]:
    """The files of a whole run that aligns, by name; ``gnss.csv`` holds the same fixes as ``gnss.nmea``."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        chosen = settings_from(list(_SETTINGS), 3)
        write_run(simulate_run(chosen), folder)
        write_vehicle_file(chosen, folder)
        files = {path.name: path.read_bytes() for path in folder.iterdir()}
    fixes, _ = parse_nmea(files["gnss.nmea"], "gnss.nmea")
    rows = zip(fixes.host_t_s, fixes.lat_deg, fixes.lon_deg, fixes.alt_m, fixes.quality, strict=True)
    text = "t,lat_deg,lon_deg,alt_m,fix_quality,sigma_m\n"
    files["gnss.csv"] = (
        text + "".join(f"{t:.4f},{lat:.9f},{lon:.9f},{alt:.3f},{q},0.02\n" for t, lat, lon, alt, q in rows)
    ).encode()
    text = "t,lat_deg,lon_deg,quality,state\n"
    rows = zip(fixes.host_t_s, fixes.lat_deg, fixes.lon_deg, fixes.quality, strict=True)
    states = ("same", "lost", "displaced")
    files["reference.csv"] = (
        text + "".join(f"{t:.4f},{lat:.9f},{lon:.9f},{q},{states[i % 3]}\n" for i, (t, lat, lon, q) in enumerate(rows))
    ).encode()
    files["degrade.json"] = b"{}"
    return files


def _short(data: bytes) -> bytes:
    return b"".join(data.splitlines(keepends=True)[:_SHORT_LINES])


def _all_sentences() -> bytes:
    lines = []
    for i in range(4):
        time = b"1200%02d.00" % i
        for one in _HEADINGS:
            filled = one % time if b"%s" in one else one
            lines.append(b"%.4f " % (1717243200 + i) + with_checksum(filled) + b"\r\n")
    return b"".join(lines)


@cache
def _messages() -> list[message_logs.Message]:
    """The first seconds of the run as messages, in order of time."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file in ("encoder.csv", "ahrs.csv", "gnss.nmea", "vehicle.toml"):
            (folder / file).write_bytes(run_files()[file])
        (source,) = discover([folder])
        run = read_run(source)
    messages = message_logs.messages_of(replace(run, reference=None), None)
    begin = messages[0][2]
    return [message for message in messages if message[2] - begin <= _SHORT_S * 1e9]


def _mcap_seeds() -> list[bytes]:
    bare: dict[str, Any] = {**message_logs.PLAIN, "enable_crcs": False, "enable_data_crcs": False}
    messages = _messages()
    first = messages[0][2]
    sentences = []
    for i, line in enumerate(run_files()["gnss.nmea"].splitlines()[:5]):
        values = {"header": message_logs.stamp(first * 1e-9), "sentence": line.partition(b" ")[2].decode()}
        sentences.append(("/nmea", "nmea_msgs/msg/Sentence", first + i, message_logs.cdr("nmea_msgs/Sentence", values)))
    without_fixes = [message for message in messages if not message[1].endswith("NavSatFix")]
    return [
        message_logs.ros2_bytes(messages, **bare),
        message_logs.ros2_bytes(messages, **bare, **message_logs.NO_CHUNKS),
        message_logs.ros2_bytes(messages),
        message_logs.ros2_bytes(messages, **message_logs.LZ4),
        message_logs.ros2_bytes(sorted(without_fixes + sentences, key=lambda one: one[2]), **bare),
        message_logs.as_json(messages, **bare),
        message_logs.as_protobuf(messages, **bare),
    ]


def _db3_seed() -> bytes:
    with tempfile.TemporaryDirectory() as name:
        folder = message_logs.write_db3(_messages(), Path(name) / "bag")
        path = next(folder.glob("*.db3"))
        with sqlite3.connect(path) as database:
            database.execute("VACUUM")
        database.close()
        return path.read_bytes()


def _bag_seed() -> bytes:
    with tempfile.TemporaryDirectory() as name:
        return message_logs.write_ros1(_messages(), Path(name) / "log.bag").read_bytes()


def seeds_of(reader: str) -> list[bytes]:
    """Samples for one reader (see ``fuzz.readers``)."""
    files = run_files()
    if reader in ("align", "cli", "rewritten"):
        names = ("encoder.csv", "ahrs.csv", "gnss.nmea", "gnss.csv", "vehicle.toml", "reference.csv")
        return [name.encode() + b"\n" + files[name] for name in names]
    angles = b"t,left_rad,right_rad,motor_current_a\n" + b"".join(
        b"%.2f,%.4f,%.4f,%.1f\n" % (0.05 * i, 0.1 * i, 0.11 * i, i % 3) for i in range(_SHORT_LINES)
    )
    return {
        "encoder": lambda: [_short(files["encoder.csv"]), angles],
        "ahrs": lambda: [_short(files["ahrs.csv"]), b"t;yaw_rad;yaw_sigma_deg;gyro_z_dps\n1;0.1;0.2;3\n2;0.2;0.2;3\n"],
        "gnss_csv": lambda: [_short(files["gnss.csv"])],
        "nmea": lambda: [_short(files["gnss.nmea"]), _all_sentences()],
        "nmea_heading": lambda: [_all_sentences()],
        "vehicle": lambda: [files["vehicle.toml"], b'name = "x"\n[nominal]\nwheel_radius_m = 1e-1\ntrack_m = 0.7\n'],
        "reference": lambda: [_short(files["reference.csv"])],
        "mcap": _mcap_seeds,
        "mcap_rewritten": _mcap_seeds,
        "db3": lambda: [_db3_seed()],
        "bag": lambda: [_bag_seed()],
    }[reader]()
