"""A simulated run as a folder of logs, in the format that ``sccal calibrate`` reads, and the truth beside it.

``truth.json`` is for whoever checks a calibration; nothing that calibrates reads it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from sccal.logs.names import AHRS_FILE, ENCODER_FILE, NMEA_FILE, VEHICLE_FILE
from sccal.logs.nmea.kinds import MODE_LETTERS
from sccal.logs.streams import Vehicle
from sccal.logs.write import gga, gst, rmc, write_table, write_text, write_vehicle, zda
from sccal.simulate.physics import Physics
from sccal.simulate.run import SimulatedRun, simulate_run
from sccal.simulate.settings import (
    AhrsSettings,
    ClockSettings,
    DriveSettings,
    EncoderSettings,
    GnssSettings,
    SimulationSettings,
)

TRUTH_SCHEMA = "sccal.truth/1"
_LINE_GAP_S = 0.001


def write_vehicle_file(settings: SimulationSettings, folder: Path) -> Path:
    """``vehicle.toml`` with the nominal values; gives its path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / VEHICLE_FILE
    vehicle = Vehicle(
        name=settings.vehicle.name,
        path=path,
        wheel_radius_m=settings.vehicle.nominal_radius_m,
        track_m=settings.vehicle.nominal_track_m,
        ticks_per_rev=float(settings.encoder.ticks_per_rev),
        counter_bits=settings.encoder.counter_bits,
        convention=settings.ahrs.convention,
    )
    write_vehicle(path, vehicle)
    return path


def write_run(simulated: SimulatedRun, folder: Path) -> None:
    """``encoder.csv``, ``ahrs.csv``, ``gnss.nmea`` and ``truth.json``; the vehicle's file may stand in any parent."""
    folder.mkdir(parents=True, exist_ok=True)
    encoder, ahrs = simulated.encoder, simulated.ahrs
    write_table(
        folder / ENCODER_FILE,
        {"t": encoder.host_t_s, "left_ticks": encoder.left_ticks, "right_ticks": encoder.right_ticks},
        {"t": "%.4f", "left_ticks": "%d", "right_ticks": "%d"},
    )
    write_table(
        folder / AHRS_FILE,
        {"t": ahrs.host_t_s, "yaw_deg": ahrs.yaw_deg, "pitch_deg": ahrs.pitch_deg, "roll_deg": ahrs.roll_deg},
        {"t": "%.4f", "yaw_deg": "%.2f", "pitch_deg": "%.2f", "roll_deg": "%.2f"},
    )
    write_text(folder / NMEA_FILE, "\n".join(nmea_lines(simulated)) + "\n")
    write_text(folder / "truth.json", json.dumps(truth(simulated), indent=2) + "\n")


def nmea_lines(simulated: SimulatedRun) -> list[str]:
    """Every epoch's GGA (and GST), and at whole seconds RMC and ZDA, each after its receive time."""
    settings, log = simulated.settings.gnss, simulated.gnss
    sigma_m = math.hypot(settings.white_sigma_m, settings.drift_sigma_m)
    whole_second = np.abs(log.utc_s - np.round(log.utc_s)) < 1e-6
    lines: list[str] = []
    rows = zip(
        log.utc_s.tolist(),
        log.host_t_s.tolist(),
        log.lat_deg.tolist(),
        log.lon_deg.tolist(),
        log.alt_m.tolist(),
        log.quality.tolist(),
        log.speed_mps.tolist(),
        log.course_deg.tolist(),
        whole_second.tolist(),
        strict=True,
    )
    for utc, host, lat, lon, alt, quality, speed, course, whole in rows:
        sentences = [gga(utc, lat, lon, alt, quality, settings.satellites, settings.hdop, settings.correction_age_s)]
        if settings.with_gst:
            sentences.append(gst(utc, sigma_m, sigma_m))
        if whole:
            sentences += [rmc(utc, lat, lon, speed, course, MODE_LETTERS.get(quality, "A")), zda(utc)]
        if settings.with_host_time:
            sentences = [f"{host + i * _LINE_GAP_S:.4f} {sentence}" for i, sentence in enumerate(sentences)]
        lines += sentences
    return lines


def _figure(value: float) -> float:
    """To four decimals, and never −0."""
    return round(float(value), 4) + 0.0


def truth(simulated: SimulatedRun) -> dict[str, object]:
    """What ``truth.json`` holds: the parameters that a calibration should find, and how they were made."""
    settings, motion = simulated.settings, simulated.motion
    along, turn = motion.steps.along_m, motion.steps.turn_rad
    offset_deg = 180.0 - (180.0 - settings.ahrs.heading_offset_deg) % 360.0
    effects = {"lever_arm": {"forward_m": settings.gnss.antenna_forward_m, "left_m": settings.gnss.antenna_left_m}}
    for effect in simulated.physics:
        effects |= {name: dict(parameters) for name, parameters in effect.truth().items()}
    return {
        "schema": TRUTH_SCHEMA,
        "vehicle": settings.vehicle.name,
        "seed": settings.seed,
        "parameters": {
            "radius_right_m": settings.vehicle.radius_right_m,
            "radius_left_m": settings.vehicle.radius_left_m,
            "track_m": settings.vehicle.track_m,
            "heading_offset_deg": offset_deg,
        },
        "effects": effects,
        "origin": {"lat_deg": settings.gnss.origin_lat_deg, "lon_deg": settings.gnss.origin_lon_deg},
        "path": {
            "duration_s": _figure(motion.t_s[-1]),
            "distance_m": _figure(np.abs(along).sum()),
            "reversed_m": _figure(-along[along < 0].sum()),
            "turned_left_deg": _figure(np.degrees(turn[turn > 0].sum())),
            "turned_right_deg": _figure(-np.degrees(turn[turn < 0].sum())),
            "fastest_mps": _figure(np.abs(along).max() / motion.step_s),
            "standing_s": _figure(np.count_nonzero((along == 0) & (turn == 0)) * motion.step_s),
            "end_east_m": _figure(motion.east_m[-1]),
            "end_north_m": _figure(motion.north_m[-1]),
            "end_yaw_deg": _figure(np.degrees(motion.yaw_rad[-1])),
        },
        "outliers": int(np.count_nonzero(simulated.gnss.outlier)),
        "settings": asdict(settings),
    }


def sample_settings() -> dict[str, SimulationSettings]:
    """The sample runs by name: one vehicle, one AHRS mounting, three drives, stamps from zero."""
    first_start_utc_s = ClockSettings().start_utc_s
    common = SimulationSettings(
        encoder=EncoderSettings(rate_hz=50.0),
        ahrs=AhrsSettings(rate_hz=20.0),
        gnss=GnssSettings(rate_hz=5.0),
    )
    drives = {
        "rectangle": DriveSettings(path="rectangle", duration_s=300.0, stand_first_s=5.0),
        "circle": DriveSettings(path="circle", duration_s=300.0, stand_first_s=5.0),
        "general": DriveSettings(path="general", duration_s=320.0, stand_first_s=5.0),
    }
    runs: dict[str, SimulationSettings] = {}
    for number, (name, drive) in enumerate(drives.items()):
        start_utc_s = first_start_utc_s + 1200.0 * number
        clock = ClockSettings(start_utc_s, host_epoch_offset_s=start_utc_s)
        runs[name] = replace(common, seed=number + 1, drive=drive, clock=clock)
    return runs


def write_samples(folder: Path, physics: Sequence[Physics] = ()) -> None:
    """``vehicle.toml`` and the runs ``rectangle``, ``circle`` and ``general`` below it."""
    runs = sample_settings()
    write_vehicle_file(next(iter(runs.values())), folder)
    for name, settings in runs.items():
        write_run(simulate_run(settings, physics), folder / name)
