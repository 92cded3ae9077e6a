"""Known cases of time: receive times in other forms, a host clock that is off, and clocks that jump or wrap."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from pathlib import Path

from studies.field.drives import varied
from studies.field.files import (
    bare,
    encoder_rows,
    nmea_lines,
    resaid,
    stamped,
    utc,
    write_ahrs,
    write_encoder,
    write_lines,
    write_run,
    write_table,
    write_vehicle,
)
from studies.field.wanted import Chapter, Diagnosis, Truth, inspected, refused, right
from studies.field.world import START_S, Log, moved, record

CLOCKS = Chapter("known", "receive times")
HOSTS = Chapter("known", "host clock")
JUMPS = Chapter("known", "clocks that jump")
STAMPS = Chapter("known", "stamps")
CHAPTERS = (CLOCKS, HOSTS, JUMPS, STAMPS)

NOT_THROWN_AWAY = (r"begin with something other than seconds", r"\b0 s, skew [+]?0 ppm")


@functools.cache
def base() -> Log:
    """The plain robot on a drive that shows everything, three minutes."""
    return record(varied(180.0, 7), 7)


@CLOCKS.case("control", right(), diagnosis=Diagnosis(nothing=True), asked=(inspected(r"good"),))
def control(folder: Path) -> Truth:
    """Nothing is wrong."""
    write_run(folder, base())
    return Truth.of(base())


def late(seconds: float = 0.25) -> Log:
    """The plain log by a logging clock that is ahead of UTC."""
    return moved(base(), seconds)


def received(
    form: Callable[[int, float, str], str], head: Sequence[str] = (), end: str = "\r\n"
) -> Callable[[Path], Truth]:
    """A log whose receive times have some form: of number, Unix seconds and sentence."""

    def build(folder: Path) -> Truth:
        log = late()
        write_vehicle(folder, log)
        write_encoder(folder, log)
        write_ahrs(folder, log)
        lines = [form(number, t, text) for number, (t, text) in enumerate(nmea_lines(log))]
        write_lines(folder / "gnss.nmea", [*head, *lines], end)
        return Truth.of(log)

    return build


def iso(t: float) -> str:
    """Date and time with microseconds."""
    return utc(t).strftime("%Y-%m-%dT%H:%M:%S.%f")


TOPIC_HEAD = ("%time,field.header.seq,field.header.stamp,field.header.frame_id,field.sentence",)
FORMS: dict[str, tuple[Callable[[int, float, str], str], Sequence[str]]] = {
    "time-iso": (lambda k, t, s: f"{iso(t)}Z {s}", ()),
    "time-arduino": (lambda k, t, s: f"{iso(t + 7200.0)[11:23]} -> {s}", ()),
    "time-bytes": (lambda k, t, s: f"{t:.4f} b'{s}\\r\\n'", ()),
    "time-rostopic": (lambda k, t, s: f"{round(t * 1e4)}00000,{k},{round(t * 1e4)}00000,gps,{s}", TOPIC_HEAD),
    "time-ms": (lambda k, t, s: f"{t * 1000.0:.0f} {s}", ()),
}
for name, (form, head) in FORMS.items():
    CLOCKS.add(name, received(form, head), right(), never=NOT_THROWN_AWAY)


@HOSTS.case("clock-off-0-2s", right(1.5), never=NOT_THROWN_AWAY[1:])
def clock_off(folder: Path) -> Truth:
    """No receive times, and a computer that is a fifth of a second ahead."""
    log = late(0.2)
    write_vehicle(folder, log)
    write_encoder(folder, log)
    write_ahrs(folder, log)
    write_lines(folder / "gnss.nmea", bare(nmea_lines(log)))
    return Truth.of(log)


def other_zero(seconds: float) -> Callable[[Path], Truth]:
    """Receive times by another clock than the tables: all lines so far off."""

    def build(folder: Path) -> Truth:
        log = base()
        write_run(folder, log)
        write_lines(folder / "gnss.nmea", stamped([(t + seconds, text) for t, text in nmea_lines(log)]))
        return Truth.of(log)

    return build


for name, off_s in (("clock-gps-time", 18.0), ("clock-97s", 97.3)):
    HOSTS.add(name, other_zero(off_s), right(1.5, ("good", "doubtful")))


def retimed(change: Callable[[float], float], log: Log | None = None) -> Callable[[Path], Truth]:
    """All streams by a clock that a function makes of Unix seconds."""

    def build(folder: Path) -> Truth:
        told = log or base()
        write_vehicle(folder, told)

        def clock(t: float) -> str:
            return f"{change(t):.6f}"

        write_encoder(folder, told, clock)
        write_ahrs(folder, told, clock)
        write_lines(folder / "gnss.nmea", [f"{clock(t)} {text}" for t, text in nmea_lines(told)])
        return Truth.of(told)

    return build


def before(t: float, until_s: float, back_s: float) -> float:
    """A clock that is set forward by so much at a moment of the run."""
    return t - (back_s if t - START_S < until_s else 0.0)


GOES_BACK = r"(goes? back|wraps?|wrapped|starts? again|midnight|set back|jump|step)"
JUMPS.add(
    "clock-from-1970",
    retimed(lambda t: before(t, 45.0, START_S - 12.0)),
    right(2.5, ("good", "doubtful")),
    asked=(inspected(),),
)
JUMPS.add(
    "clock-3-days",
    retimed(lambda t: before(t, 40.0, 3 * 86400.0)),
    right(2.5, ("good", "doubtful")),
    asked=(inspected(),),
)
JUMPS.add(
    "clock-us-wrap",
    retimed(lambda t: (t - START_S + 4294.967296 - 90.0) % 4294.967296),
    right(2.0, ("good", "doubtful")),
    refused(GOES_BACK),
    never=("do not overlap",),
)
JUMPS.add(
    "clock-midnight",
    retimed(lambda t: (t - START_S - 90.0) % 86400.0),
    right(2.0, ("good", "doubtful")),
    refused(GOES_BACK),
    never=("do not overlap",),
)
JUMPS.add(
    "clock-summer-time",
    retimed(lambda t: t + (3600.0 if t - START_S > 80.0 else 0.0)),
    right(2.5, ("good", "doubtful")),
)
JUMPS.add(
    "clock-step-5s", retimed(lambda t: t + (5.0 if t - START_S > 80.0 else 0.0)), right(2.5, ("good", "doubtful"))
)


@STAMPS.case("polled-100hz", right(1.5), never=(r"\b100 rows/s",))
def polled(folder: Path) -> Truth:
    """One loop writes the latest of everything, so each fix stands in twenty rows."""
    log = base()
    write_polled(folder, log, 100.0)
    return Truth.of(log)


def write_polled(folder: Path, log: Log, rate_hz: float) -> None:
    """Fixes as a loop writes them that is faster than the receiver."""
    write_vehicle(folder, log)
    write_encoder(folder, log)
    write_ahrs(folder, log)
    latitudes, longitudes = log.places
    rows, newest = [], 0
    for number in range(int((log.fix_t[0] + 0.05) * rate_hz), int(log.motion.end_s * rate_hz)):
        t = number / rate_hz
        while newest + 1 < log.fix_t.size and log.received_t[newest + 1] <= t:
            newest += 1
        rows.append([f"{START_S + t:.4f}", f"{latitudes[newest]:.9f}", f"{longitudes[newest]:.9f}", "4"])
    write_table(folder / "gnss.csv", ["t", "lat_deg", "lon_deg", "fix_quality"], rows)


@STAMPS.case("gga-whole-seconds", right(1.5, ("good", "doubtful")), never=("two receivers",))
def whole_seconds(folder: Path) -> Truth:
    """Five fixes a second whose epochs have lost their fractions, with receive times."""
    log = base()
    write_run(folder, log)
    write_lines(folder / "gnss.nmea", stamped([(t, whole(text)) for t, text in nmea_lines(log)]))
    return Truth.of(log)


def whole(text: str) -> str:
    """A sentence without the fraction of its second."""
    return resaid(text, lambda fields: [fields[0], fields[1][:6], *fields[2:]])


@STAMPS.case("encoder-bursts", right(2.5, ("good", "doubtful")), never=("out of order",))
def bursts(folder: Path) -> Truth:
    """Counts that are stamped when a block of a tenth of a second is read."""
    log = base()
    write_run(folder, log)
    rows = encoder_rows(log)
    write_table(
        folder / "encoder.csv", ["t", "left_ticks", "right_ticks"], [[burst(row[0], 0.1), *row[1:]] for row in rows]
    )
    return Truth.of(log)


def burst(t: str, block_s: float) -> str:
    """The end of the block in which a moment lies."""
    since = float(t) - START_S
    return f"{START_S + (int(since / block_s - 1e-9) + 1) * block_s:.4f}"
