"""One clock for all streams: the logging computer's.

A receiver stamps its epoch in UTC, exactly; the logging computer stamps the arrival, late and with jitter. Where the
log has both, the epochs are mapped onto the logging clock by a continuous, piecewise linear function through the
receive times: the jitter is gone, and a logging clock that its time daemon was steering (up to 500 ppm, tenths of a
second within minutes) is followed. How many corners the function has is decided by the Bayesian information criterion.
What the fastest lines take to arrive stays in the mapping; it cannot be told from a latency of the receiver.
"""

from __future__ import annotations

import numpy as np

from sccal.align.receive_times import Delay, fit_delay
from sccal.arrays import Bools, Floats
from sccal.errors import DataError
from sccal.logs.names import AHRS_FILE, ENCODER_FILE
from sccal.logs.streams import FixStream, Notice
from sccal.results.clock import Clock

DAY_S = 86400.0
ERA_S = 1024 * 7 * DAY_S
"""Receivers count weeks modulo 1024; after a rollover their dates may be this much in the past."""


def fixes_on_host_clock(
    fixes: FixStream, span_s: tuple[float, float], notices: list[Notice] | None = None
) -> tuple[Floats, Bools, Clock]:
    """Times of the fixes on the logging clock (n,), which of them have one (n,), and how that was done.

    span_s is the first and last time of the wheel stream, for logs whose clocks must already agree. What was met on the
    way is added to notices.
    """
    told = [] if notices is None else notices
    host, utc = fixes.host_t_s, fixes.utc_s
    both = np.isfinite(host) & np.isfinite(utc)
    if both.sum() >= 2 and np.ptp(utc[both]) > 0:
        centre = float(np.median(utc[both]))
        found = fit_delay(utc[both] - centre, (host - utc)[both])
        t_s = np.where(np.isfinite(utc), utc + found.at(utc - centre), host)
        offset = float(found.at(np.zeros(1))[0])
        _tell_delay(found, centre, offset, fixes.utc_has_date, int(both.sum()), told)
        clock = Clock(
            "utc_mapped",
            offset,
            1e6 * found.skew,
            found.jitter_s,
            found.knot_s.size,
            found.sigma_offset_s,
            1e6 * found.sigma_skew,
        )
        return t_s, np.isfinite(t_s), clock
    if np.isfinite(host).any():
        return host, np.isfinite(host), Clock("host", 0.0, 0.0, 0.0, 2)
    t_s = _in_the_era_of(utc, span_s, told) if fixes.utc_has_date else _on_the_day_of(utc, span_s)
    timed = np.isfinite(t_s)
    shift = float((t_s - utc)[timed][0]) if fixes.utc_has_date and timed.any() else 0.0
    return t_s, timed, Clock("utc", shift, 0.0, 0.0, 2)


def require_overlap(t_s: Floats, span_s: tuple[float, float], clock: Clock, what: str) -> None:
    """Raise DataError where a stream shares no time with the wheels."""
    if t_s.size and t_s[-1] >= span_s[0] and t_s[0] <= span_s[1]:
        return
    seen = f"{t_s[0]:.3f} … {t_s[-1]:.3f} s" if t_s.size else "no usable rows"
    advice = (
        f"without receive times before the NMEA lines, t in {ENCODER_FILE} and {AHRS_FILE} must be Unix time (UTC), "
        "and the motion shows no other offset between the clocks"
        if clock.source == "utc"
        else "all streams must share the logging computer's clock"
    )
    raise DataError(
        f"{what} ({seen}) and {ENCODER_FILE} ({span_s[0]:.3f} … {span_s[1]:.3f} s) do not overlap: {advice}"
    )


def _on_the_day_of(time_of_day_s: Floats, span_s: tuple[float, float]) -> Floats:
    """Times of day put on the day that brings them nearest to the wheels' span."""
    middle = 0.5 * (span_s[0] + span_s[1])
    days = np.round((middle - np.nanmedian(time_of_day_s)) / DAY_S)
    return np.asarray(time_of_day_s + days * DAY_S)


def _in_the_era_of(utc_s: Floats, span_s: tuple[float, float], notices: list[Notice]) -> Floats:
    """Epochs whose dates are whole GPS eras off the wheels' Unix time put right; others as they are."""
    if not np.isfinite(utc_s).any():
        return utc_s
    away = 0.5 * (span_s[0] + span_s[1]) - float(np.nanmedian(utc_s))
    eras = round(away / ERA_S)
    if eras == 0 or abs(away - eras * ERA_S) > DAY_S:
        return utc_s
    notices.append(_era_notice(eras, int(utc_s.size)))
    return np.asarray(utc_s + eras * ERA_S)


def _era_notice(eras: int, count: int) -> Notice:
    when = "in the past" if eras > 0 else "in the future"
    what = f"fixes dated {1024 * abs(eras)} weeks {when} by the receiver (GPS week rollover), put right"
    return Notice("gnss", what, count, "", "warning")


def _tell_delay(
    found: Delay, centre_s: float, offset_s: float, has_date: bool, count: int, notices: list[Notice]
) -> None:
    eras = round(offset_s / ERA_S)
    if has_date and eras and abs(offset_s - eras * ERA_S) <= DAY_S:
        notices.append(_era_notice(eras, count))
    if found.late:
        notices.append(Notice("gnss", "receive times not used: lines kept back in a buffer", found.late))
    if found.step_s.size:
        sizes = ", ".join(f"{-size:+.2f} s" for size in found.step_s[:5])
        first = f"UTC {np.datetime64(round(1e3 * (centre_s + found.step_at_s[0])), 'ms')}"
        what = f"steps of the receiver's time against the logging clock mended ({sizes}): leap seconds, or a clock set"
        notices.append(Notice("gnss", what, int(found.step_s.size), first, "warning"))
