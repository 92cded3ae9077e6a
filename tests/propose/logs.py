"""Logs of a simulated drive in other forms than the contract's: names, units, delimiters, encodings, signs.

What a log holds is computed here from the truth of the drive and the sensors' errors; nothing that proposes or reads a
mapping is used.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from pyproj import Transformer

from sccal.arrays import Floats
from sccal.simulate.choose import settings_from
from sccal.simulate.run import SimulatedRun, simulate_run

TICKS_PER_TURN = 4096
UNIX_S = 1717243200.0
WHEELS = ("ticks", "rad", "m", "rpm", "rad/s", "m/s")
HEADINGS = ("deg", "rad", "quaternion")
PLACES = ("degrees", "utm", "local")
TIMES = ("s", "ms", "us", "iso", "unix_s", "unix_ms", "unix_ns")

Column = tuple[str, list[str]]
Columns = list[Column]


@dataclass(frozen=True)
class Form:
    """How one logger writes."""

    wheels: str = "ticks"
    wheel_names: tuple[str, str] = ("enc_l", "enc_r")
    exchanged: bool = False
    """Whether the left wheel's numbers stand below the right one's name."""
    heading: str = "deg"
    heading_names: tuple[str, ...] = ("heading",)
    clockwise: bool = True
    places: str = "utm"
    place_names: tuple[str, str] = ("utm_e", "utm_n")
    epsg: int = 32633
    time: str = "ms"
    time_name: str = "time_ms"
    delimiter: str = ","
    decimal: str = "."
    encoding: str = "utf-8"
    one_file: bool = False
    files: tuple[str, str, str] = ("wheel.csv", "imu.csv", "gps.csv")
    quality: str = "fix"
    """Name of the column of GGA's qualities; empty for none."""
    line_end: str = "\n"
    nominal_radius_m: float = 0.08
    """What a logger of metres and m/s turns the wheels' angles by."""
    noise: tuple[str, ...] = field(default=())
    """Further columns: a voltage, a temperature."""
    rich: bool = False
    """Whether each file has whatever else its sensor says: rates, tilt, accelerations, speed, course, satellites."""
    reversed: tuple[bool, bool] = (False, False)
    """Counters that count backwards, left and right."""
    wrap_bits: int | None = None
    fix_time: str = ""
    """Form of the receiver's own times, where not the others'."""


def drive(seed: int, duration_s: float = 100.0, path: str = "general", *settings: str) -> SimulatedRun:
    """A drive with streams of usual rates."""
    chosen = ["encoder.rate_hz=50", "ahrs.rate_hz=20", "gnss.rate_hz=5", f"encoder.ticks_per_rev={TICKS_PER_TURN}"]
    place = ["gnss.origin_lat_deg=48.2", "gnss.origin_lon_deg=13.4"]
    return simulate_run(
        settings_from([f"drive.path={path}", f"drive.duration_s={duration_s}", *chosen, *place, *settings], seed)
    )


def write_log(run: SimulatedRun, form: Form, folder: Path) -> Path:
    """The drive's log in that form; gives the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    wheels, heading, fixes = _wheels(run, form), _heading(run, form), _fixes(run, form)
    if form.one_file:
        _write_one(folder / form.files[0], (wheels, heading, fixes), form)
        return folder
    own = replace(form, time=form.fix_time or form.time)
    for name, (t_s, columns), how in zip(form.files, (wheels, heading, fixes), (form, form, own), strict=True):
        _write(folder / name, [(form.time_name, _times(t_s, how)), *columns], form)
    return folder


def _number(form: Form, how: str) -> Callable[[float], str]:
    return lambda value: (how % value).replace(".", form.decimal)


def _times(t_s: Floats, form: Form) -> list[str]:
    """Stamps of seconds since 1970, as the logger writes them; short ones count from its start."""
    since = t_s - UNIX_S + 12.0
    if form.time == "iso":
        return [
            datetime.fromtimestamp(one, UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")
            for one in t_s.tolist()
        ]
    if form.time.startswith("unix"):
        unit = {"unix_s": "%.4f", "unix_ms": "%d", "unix_ns": "%d"}[form.time]
        scale = {"unix_s": 1, "unix_ms": 10**3, "unix_ns": 10**9}[form.time]
        if scale == 1:
            return [(unit % one).replace(".", form.decimal) for one in t_s.tolist()]
        return [str(round((one - UNIX_S) * scale) + round(UNIX_S) * scale) for one in t_s.tolist()]
    scale = {"s": 1.0, "ms": 1e3, "us": 1e6}[form.time]
    how = "%.4f" if form.time == "s" else "%d"
    return [(how % (scale * one)).replace(".", form.decimal) for one in since.tolist()]


def _wheels(run: SimulatedRun, form: Form) -> tuple[Floats, Columns]:
    t_s, log = run.encoder.host_t_s, run.encoder
    sign = {side: -1.0 if back else 1.0 for side, back in zip(("left", "right"), form.reversed, strict=True)}
    ticks = {"left": sign["left"] * log.left_ticks, "right": sign["right"] * log.right_ticks}
    angle = {side: 2.0 * np.pi * one / TICKS_PER_TURN for side, one in ticks.items()}
    true = {"left": sign["left"] * run.wheel_angle_rad.left, "right": sign["right"] * run.wheel_angle_rad.right}
    grid_s = run.motion.t_s + run.encoder.true_t_s[0] - run.motion.t_s[0]
    rate = {side: np.interp(log.true_t_s, grid_s, np.gradient(one, run.motion.step_s)) for side, one in true.items()}
    if form.wrap_bits is not None:
        ticks = {side: one % 2**form.wrap_bits for side, one in ticks.items()}
    written = {
        "ticks": (ticks, "%d", 1.0),
        "rad": (angle, "%.5f", 1.0),
        "m": (angle, "%.5f", form.nominal_radius_m),
        "rpm": (rate, "%.4f", 60.0 / (2.0 * np.pi)),
        "rad/s": (rate, "%.5f", 1.0),
        "m/s": (rate, "%.6f", form.nominal_radius_m),
    }
    values, how, scale = written[form.wheels]
    shown = _number(form, how)
    names = form.wheel_names[::-1] if form.exchanged else form.wheel_names
    columns = [
        (name, [shown(one) for one in (scale * values[side]).tolist()])
        for name, side in zip(names, ("left", "right"), strict=True)
    ]
    random = np.random.default_rng(run.settings.seed)
    further = [
        (name, [_number(form, "%.2f")(24.0 + one) for one in random.normal(size=t_s.size)]) for name in form.noise
    ]
    if form.rich:
        speed = 0.04 * (rate["left"] + rate["right"])
        further += _shown(form, {"cmd_v": speed, "current": np.abs(speed) + 0.1 * random.normal(size=t_s.size)})
        further += _shown(form, {"seq": np.arange(t_s.size, dtype=float), "battery": 25.0 - 1e-4 * np.arange(t_s.size)})
    return t_s, [*columns, *further]


def _heading(run: SimulatedRun, form: Form) -> tuple[Floats, Columns]:
    enu_deg = run.ahrs.yaw_deg
    deg = (90.0 - enu_deg) % 360.0 if form.clockwise else (enu_deg + 180.0) % 360.0 - 180.0
    if form.heading == "quaternion":
        half = 0.5 * np.radians(deg)
        values = {"x": 0.0 * half, "y": 0.0 * half, "z": np.sin(half), "w": np.cos(half)}
        shown = _number(form, "%.6f")
        return run.ahrs.host_t_s, [
            (name, [shown(one) for one in values[axis].tolist()])
            for name, axis in zip(form.heading_names, "xyzw", strict=True)
        ]
    numbers = deg if form.heading == "deg" else np.radians(deg)
    further = []
    if form.rich:
        random = np.random.default_rng(run.settings.seed + 1)
        rate = np.gradient(np.unwrap(np.radians(enu_deg)), run.ahrs.host_t_s)
        noise = {name: random.normal(size=deg.size) for name in ("acc_x", "acc_y", "mag_x", "temp")}
        further = _shown(form, {"roll": run.ahrs.roll_deg, "pitch": run.ahrs.pitch_deg, "gyro_z": rate, **noise})
    shown = _number(form, "%.2f" if form.heading == "deg" else "%.5f")
    return run.ahrs.host_t_s, [*further, (form.heading_names[0], [shown(one) for one in numbers.tolist()])]


def _shown(form: Form, columns: dict[str, Floats]) -> Columns:
    return [(name, [_number(form, "%.4f")(one) for one in values.tolist()]) for name, values in columns.items()]


def _fixes(run: SimulatedRun, form: Form) -> tuple[Floats, Columns]:
    log = run.gnss
    if form.places == "degrees":
        first, second, how = log.lat_deg, log.lon_deg, "%.9f"
    elif form.places == "utm":
        first, second = Transformer.from_crs(4326, form.epsg, always_xy=True).transform(log.lon_deg, log.lat_deg)
        how = "%.3f"
    else:
        first, second = _in_a_plane(log.lat_deg, log.lon_deg)
        how = "%.3f"
    shown = _number(form, how)
    columns = [
        (name, [shown(one) for one in values.tolist()])
        for name, values in zip(form.place_names, (first, second), strict=True)
    ]
    if form.quality:
        columns.append((form.quality, [str(one) for one in log.quality.tolist()]))
    if form.rich:
        further = {"speed": log.speed_mps, "course": log.course_deg, "hdop": 0.0 * log.alt_m + 0.8, "alt": log.alt_m}
        columns += _shown(form, {**further, "hAcc": 0.0 * log.alt_m + 0.014, "sats": 0.0 * log.alt_m + 14.0})
    return log.host_t_s, columns


def _in_a_plane(lat_deg: Floats, lon_deg: Floats) -> tuple[Floats, Floats]:
    """East and north of the first place (n, m), by the radii of curvature there: exact to millimetres on a field."""
    lat = np.radians(lat_deg[0])
    e2, a = 0.00669437999014, 6378137.0
    w = np.sqrt(1.0 - e2 * np.sin(lat) ** 2)
    east = np.radians(lon_deg - lon_deg[0]) * a / w * np.cos(lat)
    return east, np.radians(lat_deg - lat_deg[0]) * a * (1.0 - e2) / w**3


def _write(path: Path, columns: Columns, form: Form) -> None:
    quoted = form.decimal == form.delimiter
    rows = [[f'"{cell}"' if quoted and "," in cell else cell for cell in cells] for _, cells in columns]
    names = [name for name, _ in columns]
    lines = [form.delimiter.join(names), *(form.delimiter.join(row) for row in zip(*rows, strict=True))]
    path.write_bytes((form.line_end.join(lines) + form.line_end).encode(form.encoding))


def _write_one(path: Path, streams: tuple[tuple[Floats, Columns], ...], form: Form) -> None:
    """All streams in one table at the wheels' times, each with its latest value, as loggers of a state do."""
    t_s = streams[0][0]
    columns: Columns = [(form.time_name, _times(t_s, form))]
    for times, own in streams:
        latest = np.clip(np.searchsorted(times, t_s, side="right") - 1, 0, times.size - 1)
        columns += [(name, [cells[k] for k in latest.tolist()]) for name, cells in own]
    _write(path, columns, form)
