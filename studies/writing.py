"""A simulated log as files: vehicle.toml, encoder.csv, ahrs.csv, gnss.nmea or gnss.csv, and truth.json."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from studies.arrays import FloatArray, stream, wrap_degrees
from studies.earth import Origin, gga, gst, place_text, rmc, to_geodetic
from studies.robot import Simulated
from studies.vehicles import QUALITY

ORIGIN = Origin()
UTC_BASE_S = 1717243200
"""A full second in June 2024 from which all logs are counted."""


def write_run(log: Simulated, folder: Path) -> None:
    """All files of a run."""
    folder.mkdir(parents=True, exist_ok=True)
    _write_vehicle(log, folder / "vehicle.toml")
    _write_encoder(log, folder / "encoder.csv")
    _write_ahrs(log, folder / "ahrs.csv")
    if log.scenario.instruments.fix_format == "csv":
        _write_gnss_csv(log, folder / "gnss.csv")
    else:
        _write_nmea(log, folder / "gnss.nmea")
    (folder / "truth.json").write_text(json.dumps(truth_of(log), indent=1) + "\n", encoding="utf-8")


def clock_zero_s(log: Simulated) -> float:
    """What the logging computer's clock shows when the log begins; Unix time where no time of receipt is logged."""
    if log.scenario.instruments.fix_format == "nmea_unix":
        return UTC_BASE_S + log.utc_fraction_s
    return round(float(stream(log.scenario.seed, "clock").choice([0.0, 12.3, 4567.0, UTC_BASE_S + 3.7])), 1)


def truth_of(log: Simulated) -> dict[str, Any]:
    """All that is true of a log."""
    scenario, robot = log.scenario, log.scenario.robot
    described = asdict(scenario)
    return {
        "schema": "studies.truth/1",
        "parameters": {
            "radius_right_m": robot.radius_right_m,
            "radius_left_m": robot.radius_left_m,
            "track_m": robot.track_m,
            "heading_offset_deg": robot.heading_offset_deg,
        },
        "effects": scenario.effects,
        "noise": described["noise"],
        "columns": {column.name: {"counts_from": column.reference} for column in log.columns},
        "origin": asdict(ORIGIN),
        "log_begins_at_s": clock_zero_s(log),
        "distance_m": float(np.sum(np.abs(np.diff(log.motion.right_rad) + np.diff(log.motion.left_rad))))
        * 0.5
        * robot.nominal_radius_m,
        "scenario": described,
    }


def _table(header: Sequence[str], columns: Sequence[Sequence[str]]) -> str:
    """Cells, already text and in columns, as CSV."""
    return "\n".join([",".join(header), *map(",".join, zip(*columns, strict=True))]) + "\n"


def _texts(values: FloatArray, digits: int) -> list[str]:
    """Numbers with so many decimals."""
    return [f"{value:.{digits}f}" for value in values.tolist()]


def _write_vehicle(log: Simulated, path: Path) -> None:
    robot = log.scenario.robot
    path.write_text(
        f'name = "study-robot-{log.scenario.seed}"\n[encoder]\nticks_per_rev = {robot.ticks_per_rev}\n'
        f"[nominal]\nwheel_radius_m = {robot.nominal_radius_m}\ntrack_m = {robot.nominal_track_m}\n"
        f'[ahrs]\nconvention = "{robot.convention}"\n',
        encoding="utf-8",
    )


def _ticks(log: Simulated, told_rad: FloatArray, phase: float) -> list[str]:
    """Whole counts of an angle."""
    at_samples = np.interp(log.encoder_t_s, log.motion.t_s, told_rad)
    counts = np.floor(at_samples * log.scenario.robot.ticks_per_rev / (2.0 * np.pi) + phase)
    return [str(count) for count in counts.astype(np.int64).tolist()]


def _write_encoder(log: Simulated, path: Path) -> None:
    right, left = log.told_rad
    phases = stream(log.scenario.seed, "counter phases").random(2)
    extra = [column for column in log.columns if column.file == "encoder"]
    columns = [
        _texts(log.encoder_t_s + clock_zero_s(log), 4),
        _ticks(log, left, float(phases[0])),
        _ticks(log, right, float(phases[1])),
        *(_texts(log.column_at(column, log.encoder_t_s), column.digits) for column in extra),
    ]
    path.write_text(_table(["t", "left_ticks", "right_ticks", *(c.name for c in extra)], columns), encoding="utf-8")


def _write_ahrs(log: Simulated, path: Path) -> None:
    headings, told = log.headings, log.scenario.instruments
    yaw = headings.yaw_deg if log.scenario.robot.convention == "enu" else 90.0 - headings.yaw_deg
    rounded = np.round(wrap_degrees(yaw), told.heading_digits)
    header, columns = ["t", "yaw_deg"], [_texts(headings.t_s + clock_zero_s(log), 4)]
    columns.append(_texts(rounded, told.heading_digits))
    if told.tilt_logged or log.scenario.hills:
        header += ["pitch_deg", "roll_deg"]
        columns += [_texts(headings.pitch_deg, 2), _texts(headings.roll_deg, 2)]
    for column in log.columns:
        if column.file == "ahrs":
            header.append(column.name)
            columns.append(_texts(log.column_at(column, headings.t_s), column.digits))
    path.write_text(_table(header, columns), encoding="utf-8")


def stated_sigma_m(log: Simulated) -> float:
    """What the receiver says of each axis."""
    noise = log.scenario.noise
    honest_m = max(float(np.hypot(noise.fix_white_m, noise.fix_slow_m)), 0.001)
    return honest_m * log.scenario.instruments.stated_sigma_factor


def _write_gnss_csv(log: Simulated, path: Path) -> None:
    fixes, told = log.fixes, log.scenario.instruments
    lat_deg, lon_deg = to_geodetic(ORIGIN, fixes.east_m, fixes.north_m)
    own_clock = "clock_skew" in log.scenario.effects
    t_s = (fixes.stamp_s if own_clock else fixes.received_s) + clock_zero_s(log)
    header = ["t", "lat_deg", "lon_deg", "alt_m", "fix_quality"]
    columns = [_texts(t_s, 4), _texts(lat_deg, told.minute_digits + 2), _texts(lon_deg, told.minute_digits + 2)]
    columns += [[f"{ORIGIN.alt_m:.2f}"] * t_s.size, [str(QUALITY[told.fix_kind])] * t_s.size]
    if told.states_sigma:
        header.append("sigma_m")
        columns.append([f"{stated_sigma_m(log):.4f}"] * t_s.size)
    path.write_text(_table(header, columns), encoding="utf-8")


def _write_nmea(log: Simulated, path: Path) -> None:
    fixes, told = log.fixes, log.scenario.instruments
    quality, sigma_m = QUALITY[told.fix_kind], stated_sigma_m(log)
    places = zip(*(angle.tolist() for angle in to_geodetic(ORIGIN, fixes.east_m, fixes.north_m)), strict=True)
    utc = (fixes.stamp_s + log.utc_fraction_s + UTC_BASE_S).tolist()
    received = (fixes.received_s + clock_zero_s(log)).tolist()
    lines = []
    last_dated_s = -1
    for utc_s, received_s, (lat_deg, lon_deg) in zip(utc, received, places, strict=True):
        place = place_text(lat_deg, lon_deg, told.minute_digits)
        said = [gga(utc_s, place, quality, ORIGIN.alt_m)]
        if told.states_sigma:
            said.append(gst(utc_s, sigma_m))
        if int(utc_s + 1e-3) != last_dated_s:
            last_dated_s = int(utc_s + 1e-3)
            said.append(rmc(utc_s, place, quality))
        for number, text in enumerate(said):
            before = f"{received_s + 0.0005 * number:.4f} " if told.fix_format == "nmea" else ""
            lines.append(before + text)
    path.write_text("\r\n".join(lines) + "\r\n", encoding="ascii")
