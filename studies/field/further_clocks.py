"""Further cases of time: other forms of receive times, other host clocks, other wraps and steps, other stamps."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from studies.field.drives import headlands, road, rows
from studies.field.files import (
    FIX_HEAD,
    Line,
    ahrs_head,
    ahrs_rows,
    bare,
    encoder_head,
    encoder_rows,
    fix_row,
    nmea_lines,
    stamped,
    utc,
    without_fixes,
    write_ahrs,
    write_encoder,
    write_fixes,
    write_lines,
    write_run,
    write_table,
    write_vehicle,
)
from studies.field.further_robots import Bend, Drawn, case_of
from studies.field.known_clocks import GOES_BACK, NOT_THROWN_AWAY, before, burst, iso, whole, write_polled
from studies.field.known_wheels import CAR, TRACTOR
from studies.field.wanted import ANY_LEVEL, Chapter, Diagnosis, Truth, honest, inspected, refused, right
from studies.field.world import START_S, Ground, Log, moved, record

CONTROLS = Chapter("further", "controls")
FORMS = Chapter("further", "receive times")
HOSTS = Chapter("further", "host clock")
JUMPS = Chapter("further", "clocks that jump")
STAMPS = Chapter("further", "stamps")
CHAPTERS = (CONTROLS, FORMS, HOSTS, JUMPS, STAMPS)
PRECISE = right(2.0)
CLEAR = (right(2.5, ("good", "doubtful")),)


def plain(drawn: Drawn, folder: Path) -> Truth:
    """Nothing is wrong."""
    log = drawn.log()
    write_run(folder, log)
    return Truth.of(log)


for seed in (2001, 2002, 2003):
    CONTROLS.add(f"control-{seed}", case_of(seed, plain), PRECISE)


def control(log_of: Callable[[], Log]) -> Callable[[Path], Truth]:
    """A drive of another kind, with nothing wrong."""

    def build(folder: Path) -> Truth:
        log = log_of()
        write_run(folder, log)
        return Truth.of(log)

    return build


CONTROLS.add("control-rows", control(lambda: record(rows(9, 15.0, 0.8, 0.6), 2004)), PRECISE)
CONTROLS.add(
    "control-headlands",
    control(lambda: record(headlands(5, 45.0, 2.4), 2005, TRACTOR, Ground(0.006), soft_s=2.0)),
    PRECISE,
)
CONTROLS.add(
    "control-road",
    control(lambda: record(road(200.0, 7), 2006, replace(CAR, ticks_per_rev=2000), Ground(0.006), soft_s=2.5)),
    right(3.0),
)


def received(form: Callable[[int, float, str], str], head: Sequence[str] = (), end: str = "\r\n") -> Bend:
    """Receive times in another form, by a clock that is ahead of UTC by a drawn 0.1 to 0.3 s."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = moved(drawn.log(), float(drawn.rng.uniform(0.1, 0.3)))
        write_vehicle(folder, log)
        write_encoder(folder, log)
        write_ahrs(folder, log)
        lines = [form(number, t, text) for number, (t, text) in enumerate(nmea_lines(log))]
        write_lines(folder / "gnss.nmea", [*head, *lines], end)
        return Truth.of(log)

    return bend


def python_logging(number: int, t: float, text: str) -> str:
    """The default of a logging library: a decimal comma in the time."""
    return f"{utc(t).strftime('%Y-%m-%d %H:%M:%S')},{int(t % 1.0 * 1000):03d} INFO gnss_reader: {text}"


def syslog(number: int, t: float, text: str) -> str:
    """The system's log with microseconds."""
    return f"{utc(t).strftime('%b %e %H:%M:%S.%f')} rover gpslogger[812]: {text}"


def ros_echo(number: int, t: float, text: str) -> str:
    """A message as it is echoed to a terminal, several lines long."""
    return (
        f"header: \n  seq: {number}\n  stamp: \n    secs: {int(t)}\n    nsecs: {round(t % 1.0 * 1e9):9d}\n"
        f'  frame_id: "gps"\nsentence: "{text}"\n---'
    )


def ros2_echo(number: int, t: float, text: str) -> str:
    """The same as the newer tool prints it."""
    return (
        f"header:\n  stamp:\n    sec: {int(t)}\n    nanosec: {round(t % 1.0 * 1e9)}\n  frame_id: gps\n"
        f"sentence: {text}\n---"
    )


OTHER_FORMS: dict[str, Callable[[int, float, str], str]] = {
    "receive-13-digits-comma": lambda k, t, s: f"{round(t * 1e3)},{s}",
    "receive-16-digits": lambda k, t, s: f"{round(t * 1e6)} {s}",
    "receive-19-digits-tab": lambda k, t, s: f"{round(t * 1e6)}000\t{s}",
    "receive-brackets": lambda k, t, s: f"[{utc(t).strftime('%Y-%m-%d %H:%M:%S.%f')[:-3]}] {s}",
    "receive-iso-zone": lambda k, t, s: f"{iso(t + 7200.0)}+02:00;{s}",
    "receive-python-logging": python_logging,
    "receive-syslog": syslog,
    "receive-trailing": lambda k, t, s: f"{s} {t:.4f}",
    "receive-trailing-ms-semicolon": lambda k, t, s: f"{s};{round(t * 1e3)}",
    "receive-bytes-in-tuple": lambda k, t, s: f"({t:.6f}, b'{s}\\r\\n')",
    "receive-json-lines": lambda k, t, s: json.dumps({"t": round(t, 6), "nmea": s}),
    "receive-clock-rx": lambda k, t, s: f"{utc(t).strftime('%H:%M:%S.%f')} RX<- {s}<CR><LF>",
    "receive-ros-echo": ros_echo,
    "receive-ros2-echo": ros2_echo,
}
for number, (name, form) in enumerate(OTHER_FORMS.items()):
    end = "\n" if "echo" in name else "\r\n"
    FORMS.add(name, case_of(2100 + number, received(form, end=end)), PRECISE, never=NOT_THROWN_AWAY)
FORMS.add("receive-10-digits", case_of(2120, received(lambda k, t, s: f"{int(t)} {s}")), right(3.0, ANY_LEVEL))


def since_boot_ms(drawn: Drawn, folder: Path) -> Truth:
    """Tables in seconds since the board began, receive times in milliseconds of the same clock."""
    log = drawn.log()
    boot_s = float(drawn.rng.uniform(30.0, 300.0))
    write_vehicle(folder, log)
    clock = lambda t: f"{t - START_S + boot_s:.3f}"  # noqa: E731
    write_encoder(folder, log, clock)
    write_ahrs(folder, log, clock)
    lines = [f"{round((t - START_S + boot_s) * 1e3)} {text}" for t, text in nmea_lines(log)]
    write_lines(folder / "gnss.nmea", lines)
    return Truth.of(log)


FORMS.add("receive-ms-since-boot", case_of(2121, since_boot_ms), PRECISE, never=NOT_THROWN_AWAY[:1])


def host_off(low_s: float, high_s: float, fix_hz: float | None = None) -> Bend:
    """No receive times, and a host clock that is off by a drawn time."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        told = drawn.told if fix_hz is None else replace(drawn.told, fix_hz=fix_hz)
        log = moved(drawn.log(told=told), float(drawn.rng.uniform(low_s, high_s)))
        write_vehicle(folder, log)
        write_encoder(folder, log)
        write_ahrs(folder, log)
        write_lines(folder / "gnss.nmea", bare(nmea_lines(log)))
        return Truth.of(log)

    return bend


for name, low_s, high_s, seed in (
    ("host-behind", -0.2, -0.1, 2200),
    ("host-ahead-little", 0.05, 0.1, 2201),
    ("host-ahead-much", 0.25, 0.3, 2202),
):
    HOSTS.add(name, case_of(seed, host_off(low_s, high_s)), PRECISE, never=NOT_THROWN_AWAY[1:])
HOSTS.add("host-behind-1hz", case_of(2203, host_off(-0.25, -0.12, 1.0), 240.0), right(4.0), never=NOT_THROWN_AWAY[1:])
HOSTS.add("host-right", case_of(2204, host_off(0.0, 0.0)), PRECISE)


def heading_late(drawn: Drawn, folder: Path) -> Truth:
    """The AHRS stamps by a clock that is a second and more behind."""
    log = drawn.log()
    write_run(folder, replace(log, yaw_t=log.yaw_t + float(drawn.rng.uniform(1.0, 2.0))))
    return Truth.of(log)


HOSTS.add(
    "heading-clock-off",
    case_of(2205, heading_late),
    right(2.5, ANY_LEVEL),
    refused(r"(heading|yaw|AHRS)[^.;]{0,80}(late|shifted by|behind|ahead|\d s)"),
)


def tables_late(drawn: Drawn, folder: Path) -> Truth:
    """Fixes in a table whose stamps are late by a drawn time, as an application sees them."""
    log, late_s = drawn.log(), float(drawn.rng.uniform(0.15, 0.3))
    without_fixes(folder, log)
    write_fixes(folder, FIX_HEAD, fix_row(log), replace(log, received_t=log.received_t + late_s))
    return Truth.of(log, {"gnss_latency": {"s": late_s}})


HOSTS.add(
    "table-stamps-late",
    case_of(2206, tables_late),
    honest(),
    diagnosis=Diagnosis(names=("gnss_latency",), or_says=(r"latency|\blate\b",)),
)


def retimed(change: Callable[[Drawn, float], float]) -> Bend:
    """All streams by another clock: of Unix seconds."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log()
        write_vehicle(folder, log)

        def clock(t: float) -> str:
            return f"{change(drawn, t):.6f}"

        write_encoder(folder, log, clock)
        write_ahrs(folder, log, clock)
        write_lines(folder / "gnss.nmea", [f"{clock(t)} {text}" for t, text in nmea_lines(log)])
        return Truth.of(log)

    return bend


def share(drawn: Drawn) -> float:
    """A moment of the run, between its fifth and its half."""
    return 180.0 * (0.2 + 0.3 * ((drawn.seed * 0.618034) % 1.0))


LONGER = (right(3.5, ("good", "doubtful")),)
MILLIS = 4294967.296
JUMPS.add(
    "clock-400-days",
    case_of(2300, retimed(lambda d, t: before(t, share(d), 400 * 86400.0))),
    *LONGER,
    asked=(inspected(),),
)
JUMPS.add(
    "clock-20-years-ahead",
    case_of(2301, retimed(lambda d, t: before(t, share(d), -20 * 365.25 * 86400.0))),
    *LONGER,
    asked=(inspected(),),
)
for name, seed, change in (
    ("clock-ms-wrap", 2302, lambda d, t: (t - START_S + MILLIS - share(d)) % MILLIS),
    ("clock-signed-us-wrap", 2303, lambda d, t: (t - START_S - share(d)) % 4294.967296 - 2147.483648),
    ("clock-16-bit-ms-wrap", 2304, lambda d, t: (t - START_S + 7.0) % 65.536),
):
    JUMPS.add(name, case_of(seed, retimed(change)), *LONGER, refused(GOES_BACK), never=("do not overlap",))
JUMPS.add(
    "clock-back-an-hour",
    case_of(2305, retimed(lambda d, t: t - (3600.0 if t - START_S > share(d) else 0.0))),
    *LONGER,
    refused(GOES_BACK),
    never=("do not overlap",),
)
JUMPS.add(
    "clock-restart",
    case_of(2306, retimed(lambda d, t: t - START_S if t - START_S < share(d) else t - START_S - share(d))),
    *LONGER,
    refused(GOES_BACK),
    never=("do not overlap",),
)


def bent_stamps(write: Callable[[Drawn, Log, Path], None]) -> Bend:
    """The plain folder, and a stream that is written anew."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log()
        write_run(folder, log)
        write(drawn, log, folder)
        return Truth.of(log)

    return bend


def yaw_bursts(drawn: Drawn, log: Log, folder: Path) -> None:
    """Headings that are stamped when a block is read."""
    block_s = float(drawn.rng.uniform(0.15, 0.25))
    write_table(folder / "ahrs.csv", ahrs_head(log), [[burst(row[0], block_s), *row[1:]] for row in ahrs_rows(log)])


def whole_second_counts(drawn: Drawn, log: Log, folder: Path) -> None:
    """Counts whose times have lost their fractions."""
    found = encoder_rows(log)
    write_table(folder / "encoder.csv", encoder_head(log), [[str(int(float(row[0]))), *row[1:]] for row in found])


def whole_second_epochs(drawn: Drawn, log: Log, folder: Path) -> None:
    """Epochs without fractions, with receive times."""
    write_lines(folder / "gnss.nmea", stamped([(t, whole(text)) for t, text in nmea_lines(log)]))


def polled(drawn: Drawn, log: Log, folder: Path) -> None:
    """A loop of a drawn rate, which is no multiple of the receiver's, writes the newest fix."""
    (folder / "gnss.nmea").unlink()
    write_polled(folder, log, float(drawn.rng.uniform(21.0, 43.0)))


def polled_all(drawn: Drawn, log: Log, folder: Path) -> None:
    """Each line of the receiver is written again until a newer one comes."""
    lines: list[Line] = [(t, text) for t, text in nmea_lines(log) if "GGA" in text]
    again = []
    for (t, text), (next_t, _) in pairwise(lines):
        again += [(t + 0.02 * number, text) for number in range(max(1, int((next_t - t) / 0.02)))]
    write_lines(folder / "gnss.nmea", stamped(again))


JITTERED = (right(3.0, ANY_LEVEL),)
STAMPS.add("yaw-bursts", case_of(2400, bent_stamps(yaw_bursts)), *JITTERED, never=("out of order",))
STAMPS.add(
    "counts-whole-seconds",
    case_of(2401, bent_stamps(whole_second_counts)),
    right(6.0, ANY_LEVEL),
    refused(r"(whole seconds|fraction|rows? (with|of|under) (one|the same) (time|stamp)|share)"),
    never=("out of order",),
)
STAMPS.add("epochs-whole-seconds", case_of(2402, bent_stamps(whole_second_epochs)), *CLEAR, never=("two receivers",))
STAMPS.add("polled-odd-rate", case_of(2403, bent_stamps(polled)), *JITTERED)
STAMPS.add("polled-sentences", case_of(2404, bent_stamps(polled_all)), *CLEAR)
