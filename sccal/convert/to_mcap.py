"""Tables as an MCAP file in the ros2 profile, with what standard messages cannot hold beside them.

``/joint_states`` (JointState: wheel angles, counts turned into radians), ``/imu/data`` (Imu), ``/nmea_sentence``
(nmea_msgs/Sentence, every line) or ``/fix`` (NavSatFix), and ``/encoder/…``, ``/ahrs/…``, ``/gnss/…`` (Float64):
further columns, and those that cannot be had back from the standard message bit by bit: see
``sccal.logs.messages.converted``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from sccal.arrays import Bools, Floats
from sccal.convert.tables import LogTable, NmeaLines, RunTables, stamps_of, time_places
from sccal.logs.messages.converted import (
    CONVERTED,
    LEFT_JOINT,
    RIGHT_JOINT,
    ConversionNote,
    TableKind,
    TableNote,
    recovered,
)
from sccal.logs.messages.write import (
    FIX_TOPIC,
    HEADING_TOPIC,
    NMEA_TOPIC,
    WHEELS_TOPIC,
    Stamped,
    encoded,
    imu,
    imu_numbers,
    joint_states,
    nav_sat_fixes,
    nav_sat_numbers,
    sentence_messages,
    write_topics,
)
from sccal.logs.names import VEHICLE_FILE
from sccal.logs.streams import Convention, FixStream, HeadingStream, WheelStream

LIBRARY = "sccal convert"
_TEXT = "application/toml"
_TURN = 2 * np.pi


def write_mcap_of(tables: RunTables, path: Path, compression: str = "zstd") -> None:
    """Write a run; the same bytes every time.

    Raises:
        DataError: times that ROS messages cannot hold.
    """
    topics, note = _topics(tables)
    ahead = note.log_ahead_ns
    if ahead:
        topics = [_ahead(topic, ahead) for topic in topics]
    vehicle = {VEHICLE_FILE: (_TEXT, tables.vehicle_text)}
    write_topics(path, topics, {CONVERTED: note.as_metadata()}, vehicle, compression, LIBRARY)


def _ahead(topic: Stamped, ahead_ns: int) -> Stamped:
    return Stamped(topic.topic, topic.type_name, topic.stamp_ns, topic.messages, topic.log_times_ns + ahead_ns)


def _topics(tables: RunTables) -> tuple[list[Stamped], ConversionNote]:
    convention = tables.vehicle.convention
    notes: dict[str, TableNote] = {}
    topics = _encoder(tables, notes)
    if tables.ahrs is not None:
        topics += _ahrs(tables.ahrs, convention, tables.path, notes)
    if tables.gnss is not None:
        topics += _gnss(tables.gnss, convention, tables.path, notes)
    places = None
    if tables.nmea is not None:
        topics.append(_sentences(tables.nmea, tables.path))
        places = _receive_places(tables.nmea)
    first_ns = min(int(topic.log_times_ns.min()) for topic in topics if topic.stamp_ns.size)
    return topics, ConversionNote(
        tables=notes,
        nmea_topic=NMEA_TOPIC if tables.nmea is not None else "",
        nmea_places=places,
        log_ahead_ns=-(min(first_ns, 0) // 1_000_000_000) * 1_000_000_000,
        notices=tables.notices,
    )


def _receive_places(nmea: NmeaLines) -> int:
    places = time_places(nmea.host_t_s[nmea.stamped])
    return 9 if places is None else places


def _sentences(nmea: NmeaLines, path: Path) -> Stamped:
    stamp_ns = np.where(nmea.stamped, stamps_of(np.where(nmea.stamped, nmea.host_t_s, 0.0), path), 0)
    stamp_ns[nmea.stamped & (stamp_ns == 0)] = 1  # a stamp of zero is none
    return sentence_messages(stamp_ns, nmea.texts, stamps_of(nmea.shown_s, path))


def _encoder(tables: RunTables, notes: dict[str, TableNote]) -> list[Stamped]:
    table = tables.encoder
    in_ticks = "left_ticks" in table.columns
    ticks_per_rev = tables.vehicle.ticks_per_rev if in_ticks else None
    left, right = (table.columns[f"{side}_{'ticks' if in_ticks else 'rad'}"] for side in ("left", "right"))
    if ticks_per_rev:
        left, right = left * (_TURN / ticks_per_rev), right * (_TURN / ticks_per_rev)
    wheels = WheelStream(table.t_s, left, right, np.zeros(left.size, dtype=np.bool_))
    held = {f"position {LEFT_JOINT}": left, f"position {RIGHT_JOINT}": right}
    topic = joint_states(wheels)
    note = TableNote(WHEELS_TOPIC, table.places, {}, table.time_places, ticks_per_rev)
    return [topic, *_beside("encoder", table, note, held, "enu", tables.path, notes)]


def _ahrs(table: LogTable, convention: Convention, path: Path, notes: dict[str, TableNote]) -> list[Stamped]:
    def angle(name: str, unit: str = "deg", in_rad: str = "rad") -> Floats | None:
        if f"{name}_{unit}" in table.columns:
            return np.radians(table.columns[f"{name}_{unit}"])
        return table.columns.get(f"{name}_{in_rad}")

    yaw = angle("yaw")
    assert yaw is not None
    sigma = angle("yaw_sigma")
    heading = HeadingStream(
        t_s=table.t_s,
        yaw_rad=yaw,
        yaw_sigma_rad=None if sigma is None else np.where(sigma > 0, sigma, np.nan),
        pitch_rad=angle("pitch"),
        roll_rad=angle("roll"),
        gyro_z_radps=angle("gyro_z", "dps", "radps"),
    )
    topic = imu(heading, convention)
    whole = bool(yaw.min() >= 0 and yaw.max() > np.pi)
    note = TableNote(HEADING_TOPIC, table.places, {}, table.time_places, None, whole)
    return [topic, *_beside("ahrs", table, note, _imu_numbers(heading, convention), convention, path, notes)]


def _imu_numbers(heading: HeadingStream, convention: Convention) -> dict[str, Floats]:
    """What a reader finds in the messages of ``imu``, by its own names."""
    numbers = imu_numbers(heading, convention)
    absent = np.full(heading.t_s.size, np.nan)
    return {
        **{axis: numbers[f"orientation.{axis}"] for axis in "xyzw"},
        "cov_yaw": numbers.get("orientation_covariance[8]", absent),
        "gyro_z": numbers.get("angular_velocity.z", absent),
    }


def _gnss(table: LogTable, convention: Convention, path: Path, notes: dict[str, TableNote]) -> list[Stamped]:
    absent = np.full(table.t_s.size, np.nan)
    lat, lon = table.columns["lat_deg"], table.columns["lon_deg"]
    quality = table.columns.get("fix_quality", absent)
    sigma = table.columns.get("sigma_m", absent)
    east, north = (table.columns.get(f"sigma_{axis}_m", sigma) for axis in ("east", "north"))
    covariance = np.nan_to_num(table.columns.get("cov_en_m2", absent))
    codes = np.where(np.isfinite(quality) & (quality >= 0) & (quality <= 9), np.round(np.nan_to_num(quality)), -1)
    fixes = FixStream(
        host_t_s=table.t_s,
        utc_s=absent,
        utc_has_date=False,
        lat_deg=lat,
        lon_deg=np.where(np.abs(lon) > 180, (lon + 180) % 360 - 180, lon),
        alt_m=table.columns.get("alt_m", absent),
        quality=codes.astype(np.int64),
        sigma_east_m=np.where(east > 0, east, np.nan),
        sigma_north_m=np.where(north > 0, north, np.nan),
        cov_en_m2=covariance,
    )
    topic = nav_sat_fixes(fixes)
    numbers = nav_sat_numbers(fixes)
    held = {
        "latitude": numbers["latitude"],
        "longitude": numbers["longitude"],
        "altitude": numbers["altitude"],
        "status": numbers["status.status"],
        "cov_ee": numbers["position_covariance[0]"],
        "cov_en": numbers["position_covariance[1]"],
        "cov_nn": numbers["position_covariance[4]"],
        "cov_type": numbers["position_covariance_type"],
    }
    note = TableNote(FIX_TOPIC, table.places, {}, table.time_places)
    return [topic, *_beside("gnss", table, note, held, convention, path, notes)]


def _beside(
    kind: TableKind,
    table: LogTable,
    note: TableNote,
    held: Mapping[str, Floats],
    convention: Convention,
    path: Path,
    notes: dict[str, TableNote],
) -> list[Stamped]:
    """Topics for the columns that the standard messages do not hold to the last bit; notes the table."""
    stamps_of(table.t_s, path)
    absent = np.full(table.t_s.size, np.nan)
    back = recovered(kind, note, lambda name: held.get(name, absent), convention)
    side: dict[str, str] = {}
    topics = []
    for name, column in table.columns.items():
        if _same_bits(back[name], column):
            continue
        side[name] = topic = _topic(kind, name, side)
        rows = np.isfinite(column)
        topics.append(encoded(topic, "std_msgs/msg/Float64", table.t_s[rows], {}, {}, {"data": column[rows]}))
    notes[kind] = TableNote(note.topic, note.columns, side, note.time_places, note.ticks_per_rev, note.whole_turn)
    return topics


def _same_bits(one: Floats, other: Floats) -> bool:
    same: Bools = (one == other) & (np.signbit(one) == np.signbit(other)) | (np.isnan(one) & np.isnan(other))
    return bool(same.all())


def _topic(kind: str, name: str, taken: Mapping[str, str]) -> str:
    stem = re.sub(r"[^A-Za-z0-9_]+", "_", name).strip("_") or "column"
    stem = stem if stem[0].isalpha() else f"c_{stem}"
    topic, number = f"/{kind}/{stem}", 2
    while topic in taken.values():
        topic, number = f"/{kind}/{stem}_{number}", number + 1
    return topic
