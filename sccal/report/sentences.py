"""One line each for fit, outage, noise, clock and drive: the same words in the terminal and on the page."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from sccal.logs.streams import Notice
from sccal.results.calibration import (
    AgainstReference,
    Drive,
    Fit,
    HeldOut,
    Missing,
    Outage,
    OutageWindow,
    Unseen,
)
from sccal.results.clock import Clock
from sccal.results.noise import Noise
from sccal.results.numbers import MISSING, duration, one_line, plain, short, value_and_sigma

LOSSES_SHOWN = 5
LEARNT = "drift by what was learnt so far"
"""Of the forward filter: what the robot would have met on the way."""


def held_out_drift(window_s: float) -> str:
    """What calibrations and diagnoses call the drift that was judged by data which fitted neither."""
    return f"drift after {short(window_s)} s without fixes, held out"


def fixes_line(fit: Fit) -> str:
    """Innovations of the position fixes."""
    counts = _counts(fit.fixes_used, fit.fixes_rejected)
    return f"innovation {_measured(fit.gnss_innovation_rms_m, 'm')} rms, NIS {short(fit.nis_gnss, 3)}, {counts}"


def headings_line(fit: Fit) -> str:
    """Innovations of the AHRS readings."""
    counts = _counts(fit.headings_used, fit.headings_rejected)
    rms_deg = math.degrees(fit.heading_innovation_rms_rad)
    return f"innovation {_measured(rms_deg, 'deg')} rms, NIS {short(fit.nis_heading, 3)}, {counts}"


def recoveries_line(fit: Fit) -> str:
    """Empty where there was none."""
    if not fit.recoveries:
        return ""
    times = "once" if fit.recoveries == 1 else f"{fit.recoveries} times"
    return f"the filter had locked itself out and was opened again {times}"


def outage_line(outage: Outage) -> str:
    """Drift at the end of the windows without fixes, then on the way."""
    window = short(outage.window_s)
    count = len(outage.windows)
    if outage.end_rms_m is None:
        return f"{LEARNT}: no window of {window} s fits into the data"
    share = "" if outage.percent_of_distance is None else f" ({plain(outage.percent_of_distance, 2)} % of distance)"
    return (
        f"{LEARNT}: {_measured(outage.end_rms_m, 'm', 2)} rms after {window} s without fixes{share}, "
        f"{count} window{'' if count == 1 else 's'}"
    )


def held_out_line(held_out: HeldOut | None, window_s: float) -> str:
    """The same quantity as before and after of a diagnosis; empty where it was not judged."""
    if held_out is None or held_out.outage_end_rms_m is None:
        return ""
    rms = _measured(held_out.outage_end_rms_m, "m", 3)
    return one_line(f"{held_out_drift(window_s)}: {rms} rms ({held_out.how})")


def missing_line(missing: Sequence[Missing]) -> str:
    """What a quick look says that the model lacks; empty where it lacks nothing."""
    parts = [
        f"{lack.effect} (evidence {plain(lack.evidence_nats, 3)} nats, {plain(lack.size, 2)} times "
        "the size that matters)"
        for lack in missing
    ]
    return one_line(f"by a quick look, {', '.join(parts)}; see `sccal diagnose`") if parts else ""


def reference_lines(judged: AgainstReference | None) -> tuple[str, ...]:
    """What fixes that the filter never saw say: a line for each loss, one for all displaced fixes."""
    if judged is None:
        return ()
    lines = [_loss_line(window) for window in judged.losses.windows[:LOSSES_SHOWN]] if judged.losses else []
    if judged.losses and len(judged.losses.windows) > LOSSES_SHOWN:
        rms = _measured(judged.losses.end_rms_m or math.nan, "m", 3)
        lines.append(f"… {len(judged.losses.windows)} losses in all, {rms} rms at their ends")
    if judged.displaced_rms_m is not None:
        rms = _measured(judged.displaced_rms_m, "m")
        lines.append(
            f"{judged.displaced} fixes are displaced; the filter on its way is {rms} rms from their true places"
        )
    return tuple(lines)


def _loss_line(window: OutageWindow) -> str:
    length = plain(window.end_s - window.start_s, 3)
    share = 100.0 * window.end_drift_m / window.distance_m if window.distance_m > 0.0 else math.nan
    end, rms = _measured(window.end_drift_m, "m"), _measured(window.rms_drift_m, "m")
    return (
        f"no fixes for {length} s from t = {window.start_s:.2f} s: drift {end} at the end "
        f"({plain(share, 2)} % of {_measured(window.distance_m, 'm')}), {rms} rms on the way"
    )


def unseen_line(unseen: Sequence[Unseen]) -> str:
    """Parameters beyond the model that these data do not show; empty where they show all that was asked."""
    if not unseen:
        return ""
    parts = [f"{item.effect} {item.parameter} below {plain(item.smallest, 2)} {item.unit}" for item in unseen]
    return f"these data would not show {', '.join(parts)}"


def unseen_in_all(runs: Sequence[Sequence[Unseen]]) -> tuple[Unseen, ...]:
    """What no run shows, each by the run that comes nearest to showing it."""
    found = []
    for one in runs[0] if runs else ():
        same = [o for run in runs for o in run if (o.effect, o.parameter) == (one.effect, one.parameter)]
        if len(same) == len(runs):
            found.append(min(same, key=lambda o: o.smallest))
    return tuple(found)


def noise_facts(noise: Noise) -> tuple[tuple[str, str], ...]:
    """Heading, fixes and wheels, as the filter used them."""
    white = _measured(math.degrees(noise.heading_white_rad), "deg", 2)
    return (
        ("heading", f"{white} white{_coloured(math.degrees(noise.heading_coloured_rad), 'deg', noise.heading_tau_s)}"),
        ("fixes", f"{plain(noise.fix_scale, 2)} x stated sigma{_coloured(noise.fix_coloured_m, 'm', noise.fix_tau_s)}"),
        ("wheels", f"{_measured(noise.slip_m_per_sqrt_m, 'm', 2)} after 1 m, growing with the root of distance"),
        ("source", "estimated from the log" if noise.source == "estimated" else "given, not estimated"),
    )


def clock_line(clock: Clock) -> str:
    """How the fixes came onto the logging clock."""
    if clock.source == "host":
        return "fixes at their receive times, as logged"
    offset, skew = _with_sigma(clock.offset_s, clock.sigma_offset_s), _with_sigma(clock.skew_ppm, clock.sigma_skew_ppm)
    if clock.source == "motion":
        what = "fixes put on the wheels' clock by their motion"
        return f"{what}: {offset} s, skew {skew} ppm (a latency of the receiver included)"
    way = "the logging clock is Unix time" if clock.source == "utc" else "receiver epochs mapped onto the logging clock"
    steered = f", steered ({clock.knots} knots)" if clock.knots > 2 else ""
    jitter = plain(1e3 * clock.jitter_s, 2) if math.isfinite(clock.jitter_s) else MISSING
    return f"{way}: {offset} s, skew {skew} ppm, jitter {jitter} ms{steered}"


def _with_sigma(value: float, sigma: float) -> str:
    if not sigma > 0.0:
        return _signed(value)
    text, error = value_and_sigma(value, sigma)
    return f"{text if text.startswith('-') else '+' + text} ± {error}"


def drive_line(drive: Drive) -> str:
    """What the driver can change next time."""
    turned = f"turned {_degrees(drive.turned_left_rad)} left, {_degrees(drive.turned_right_rad)} right"
    return (
        f"{duration(drive.duration_s)}, {plain(drive.distance_m)} m ({plain(drive.reversed_m)} m backwards), "
        f"up to {plain(drive.max_speed_mps, 2)} m/s, standing {duration(drive.standing_s)}, {turned}"
    )


def warnings_first(notices: Iterable[Notice]) -> list[Notice]:
    """Warnings before the rest, otherwise in the order in which they were met."""
    return sorted(notices, key=lambda notice: notice.severity != "warning")


def notice_text(notice: Notice) -> str:
    """On one line, whatever a file's name or cells held."""
    return one_line(str(notice))


def _counts(used: int, rejected: int) -> str:
    return f"{used} used, {rejected} rejected"


def _measured(value: float, unit: str, digits: int = 3) -> str:
    text = plain(value, digits)
    return text if text == MISSING else f"{text} {unit}"


def _coloured(sigma: float, unit: str, tau_s: float) -> str:
    if not sigma > 0.0:
        return ""
    return f" + {plain(sigma, 2)} {unit} over {plain(tau_s, 2)} s"


def _signed(value: float) -> str:
    text = plain(value, 4)
    return text if text.startswith("-") or text in (MISSING, "0") else f"+{text}"


def _degrees(angle_rad: float) -> str:
    return f"{math.degrees(angle_rad):.0f} deg" if math.isfinite(angle_rad) else MISSING
