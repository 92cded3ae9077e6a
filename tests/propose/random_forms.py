"""Forms of logs drawn at random, and whether what `sccal init` and a calibration make of one is the truth."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from sccal.errors import DataError
from sccal.logs.run import discover, read_run
from sccal.propose.propose import Proposal, Told, propose
from sccal.simulate.run import SimulatedRun
from tests.propose.logs import TICKS_PER_TURN, Form, drive, write_log

WHEEL_NAMES = (
    *(("enc_l", "enc_r"), ("left", "right"), ("LeftWheel", "RightWheel"), ("l_ticks", "r_ticks"), ("wl", "wr")),
    *(
        ("wheel_left [rad]", "wheel_right [rad]"),
        ("rpm_left", "rpm_right"),
        ("v_l", "v_r"),
        ("odo links", "odo rechts"),
    ),
    *(("M1", "M2"), ("motor_a", "motor_b"), ("encL", "encR"), ("left_rad", "left_rad2"), ("speedLeft", "speedRight")),
)
HEADING_NAMES = ("heading", "hdg", "yaw", "yaw_rad", "heading_deg", "Azimuth", "psi", "compass", "ahrs.yaw", "col7")
PLACE_NAMES = {
    "degrees": (("lat", "lon"), ("Latitude", "Longitude"), ("gps_lat", "gps_lng"), ("GPSLat[deg]", "GPSLon[deg]")),
    "utm": (
        ("utm_e", "utm_n"),
        ("easting", "northing"),
        ("UTM_X", "UTM_Y"),
        ("E", "N"),
        ("utm33n_east", "utm33n_north"),
    ),
    "local": (("east", "north"), ("x", "y"), ("pos_e", "pos_n"), ("x_m", "y_m")),
}
TIME_NAMES = {
    **{
        "s": ("t", "time", "Time [s]", "stamp"),
        "ms": ("time_ms", "millis", "t", "timestamp"),
        "us": ("micros", "time_us"),
    },
    **{"iso": ("time", "datetime", "Zeit"), "unix_s": ("t", "time", "epoch"), "unix_ms": ("timestamp", "unix_ms")},
    **{"unix_ns": ("stamp", "t_ns")},
}
FILES = (("wheel.csv", "imu.csv", "gps.csv"), ("enc.txt", "ahrs.dat", "rtk.log"), ("A.CSV", "B.CSV", "C.CSV"))
DELIMITERS = ((",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), (" ", "."))
ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "latin-1")


@dataclass(frozen=True)
class Case:
    """One random log, the proposal made of it, and what a calibration by it is off."""

    form: Form
    proposal: Proposal | None
    why: str
    """Empty where all is right."""


def random_form(seed: int) -> Form:
    """Names, units, signs, delimiter and encoding, each drawn on its own."""
    random = np.random.default_rng(seed)

    def one_of(choices: tuple) -> object:  # type: ignore[type-arg]
        return choices[int(random.integers(len(choices)))]

    wheels = str(one_of(("ticks", "ticks", "rad", "m", "rpm", "rad/s", "m/s")))
    heading = str(one_of(("deg", "deg", "rad", "quaternion")))
    stems = ("q", "orientation.", "quat_")
    stem = str(one_of(stems))
    names = tuple(f"{stem}{axis}" for axis in "xyzw") if heading == "quaternion" else (str(one_of(HEADING_NAMES)),)
    places = str(one_of(("degrees", "utm", "local")))
    time = str(one_of(tuple(TIME_NAMES)))
    delimiter, decimal = one_of(DELIMITERS)  # type: ignore[misc]
    time_name = str(one_of(TIME_NAMES[time]))
    pairs = one_of(WHEEL_NAMES)
    spaced = delimiter == " "
    return Form(
        wheels=wheels,
        wheel_names=tuple(name.replace(" ", "_") if spaced else name for name in pairs),  # type: ignore[attr-defined,arg-type]
        exchanged=bool(random.random() < 0.2),
        heading=heading,
        heading_names=names,
        clockwise=bool(random.random() < 0.5),
        places=places,
        place_names=one_of(PLACE_NAMES[places]),  # type: ignore[arg-type]
        time=time,
        time_name=time_name.replace(" ", "_") if spaced else time_name,
        delimiter=delimiter,
        decimal=decimal,
        encoding=str(one_of(ENCODINGS)),
        one_file=bool(random.random() < 0.2),
        files=one_of(FILES),  # type: ignore[arg-type]
        quality=str(one_of(("fix", "Quality", ""))),
        line_end=str(one_of(("\n", "\r\n"))),
        noise=tuple(str(name) for name in one_of(((), ("volt",), ("temp_c", "amps")))),  # type: ignore[attr-defined]
        rich=bool(random.random() < 0.4),
        reversed=(bool(random.random() < 0.15), bool(random.random() < 0.15)),
        wrap_bits=16 if wheels == "ticks" and random.random() < 0.2 else None,
        nominal_radius_m=round(0.08 * _size(seed), 3),
    )


def _size(seed: int) -> float:
    """How many times as large as the simulator's the vehicle's wheels are: from 4 to 40 cm of radius."""
    return float(np.exp(np.random.default_rng(seed + 1).uniform(np.log(0.5), np.log(5.0))))


def random_drive(seed: int, duration_s: float) -> SimulatedRun:
    """A vehicle of any size on any path that turns."""
    random, size = np.random.default_rng(seed + 2), _size(seed)
    path = str(random.choice(["general", "general", "rectangle", "figure8", "calibration"]))
    radii = [f"vehicle.radius_{side}_m={0.08 * size * random.uniform(0.98, 1.02):.5f}" for side in ("left", "right")]
    track = f"vehicle.track_m={random.uniform(0.35, 1.6):.3f}"
    offset = f"ahrs.heading_offset_deg={random.uniform(-180.0, 180.0):.1f}"
    return drive(seed, duration_s, path, *radii, track, offset)


def tried(seed: int, folder: Path, duration_s: float = 100.0) -> Case:
    """A log of a random form: proposed, written, calibrated, and held against the truth."""
    form = random_form(seed)
    run = random_drive(seed, duration_s)
    write_log(run, form, folder)
    told = Told(ticks_per_turn=TICKS_PER_TURN) if form.wheels == "ticks" else Told(radius_m=form.nominal_radius_m)
    try:
        proposal = propose(folder, told)
    except DataError as error:
        return Case(form, None, f"not proposed: {error}")
    (folder / "vehicle.toml").write_text(proposal.text, encoding="utf-8")
    try:
        (source,) = discover([folder])
        calibration, _ = calibrate_run(read_run(source), CalibrationOptions())
        found = calibration.parameters
    except DataError as error:
        return Case(form, proposal, f"not calibrated: {error}")
    vehicle = run.settings.vehicle
    truth = {
        "radius_right_m": vehicle.radius_right_m,
        "radius_left_m": vehicle.radius_left_m,
        "track_m": vehicle.track_m,
    }
    off = []
    for name, true in truth.items():
        one = getattr(found, name)
        far = name.startswith("radius") and abs(one.value / true - 1.0) > 0.01
        if far or abs(one.value - true) > 4.0 * one.sigma:
            off.append(f"{name} {one.value:.5f} ± {one.sigma:.5f}, truth {true:.5f}")
    if form.exchanged and any("turns too little to show which wheel" in doubt for doubt in proposal.doubts):
        off = []  # all on one line, which is its own mirror image: it is said that the names decide, and they are wrong
    return Case(form, proposal, "; ".join(off))


def short(text: str) -> str:
    """A message in one line."""
    return re.sub(r"\s+", " ", text)[:300]
