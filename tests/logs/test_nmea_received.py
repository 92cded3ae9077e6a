"""Receive times in every form: each is read to the millisecond, told, and none is made of what is no time."""

from __future__ import annotations

import datetime as dt
import json

import numpy as np
import pytest

from sccal.logs.nmea import parse_nmea
from sccal.logs.streams import FixStream, Notice
from sccal.logs.write import gga, rmc

NOON_S = 1717243200.0
LATE_S = 0.271


def utc(t: float) -> dt.datetime:
    return dt.datetime.fromtimestamp(t, dt.UTC)


def iso(t: float) -> str:
    return utc(t).strftime("%Y-%m-%dT%H:%M:%S.%f")


FORMS = {
    "iso": lambda k, t, s: f"{iso(t)}Z {s}",
    "zone": lambda k, t, s: f"{iso(t - 12600.0)}-03:30;{s}",
    "local": lambda k, t, s: f"[{iso(t + 7200.0)[:23].replace('T', ' ')}] {s}",
    "logging": lambda k, t, s: f"{utc(t):%Y-%m-%d %H:%M:%S},{int(t % 1 * 1000):03d} INFO gnss {k}: {s}",
    "time of day": lambda k, t, s: f"{iso(t + 7200.0)[11:23]} -> {s}",
    "syslog": lambda k, t, s: f"{utc(t):%b %e %H:%M:%S.%f} rover gps[812]: {s}",
    "milliseconds": lambda k, t, s: f"{t * 1e3:.0f},{s}",
    "microseconds": lambda k, t, s: f"{t * 1e6:.0f} {s}",
    "nanoseconds": lambda k, t, s: f"{k},{round(t * 1e6)}000,gps,{s}",
    "bytes": lambda k, t, s: f"({t:.6f}, b'{s}\\r\\n')",
    "behind": lambda k, t, s: f"{s};{t * 1e3:.0f}",
    "json": lambda k, t, s: json.dumps({"n": k, "t": t, "nmea": s}),
    "ros": lambda k, t, s: f'header:\n  seq: {k}\n  secs: {int(t)}\n  nsecs: {t % 1 * 1e9:9.0f}\nsentence: "{s}"\n---',
}


def read(form, end: str = "\r\n") -> tuple[FixStream, tuple[Notice, ...]]:
    lines = []
    for k in range(60):
        t = NOON_S + 0.2 * k
        said = [gga(t, 52.1, 5.3, 40.0, 4, 12, 0.6, 0.8), *([rmc(t, 52.1, 5.3, 1.0, 90.0, 4)] if k % 5 == 0 else [])]
        lines += [form(len(lines), t + LATE_S, text) for text in said]
    return parse_nmea(end.join([*lines, ""]).encode(), "gnss.nmea")


@pytest.mark.parametrize("name", FORMS)
def test_a_receive_time_is_read_in_any_form(name: str) -> None:
    fixes, notices = read(FORMS[name])
    assert fixes.lat_deg.size == 60
    assert fixes.host_t_s - fixes.utc_s == pytest.approx(np.full(60, LATE_S), abs=1.1e-3)
    assert [notice for notice in notices if "receive times read as" in notice.what]


def test_the_zone_that_was_taken_is_told() -> None:
    assert any("UTC+2 h" in notice.what for notice in read(FORMS["time of day"])[1])


def test_milliseconds_since_the_board_began_are_seconds_of_the_same_clock() -> None:
    fixes, notices = read(lambda _, t, s: f"{(t - NOON_S + 100.0) * 1e3:.0f} {s}")
    assert fixes.host_t_s == pytest.approx(fixes.utc_s - NOON_S + 100.0 + LATE_S, abs=1e-3)
    assert any("receive times read as ms" in notice.what for notice in notices)


def test_a_count_of_lines_is_no_time() -> None:
    fixes, notices = read(lambda k, _, s: f"line {k} of gps: {s}")
    assert np.isnan(fixes.host_t_s).all()
    assert any("no receive time read" in notice.what for notice in notices)


def test_plain_seconds_need_no_word() -> None:
    fixes, notices = read(lambda _, t, s: f"{t:.4f} {s}")
    assert fixes.host_t_s - fixes.utc_s == pytest.approx(np.full(60, LATE_S), abs=1e-4)
    assert not notices


def test_utf_16_is_read() -> None:
    line = f"{NOON_S:.3f} {gga(NOON_S, 52.1, 5.3, 40.0, 4, 12, 0.6, 0.8)}\r\n"
    for text in (("\ufeff" + line).encode("utf-16-le"), line.encode("utf-16-le"), line.encode("utf-16")):
        assert parse_nmea(text * 1, "gnss.nmea")[0].lat_deg == pytest.approx([52.1])
