"""Writing ``reference.csv`` (see ``sccal.logs.reference``): the fixes of a run as they were before the fault.

Positions have 13 decimals of a degree (10 nm), times six. Where a log is degraded again, its reference stays that of
the first time, with the states of both.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sccal.arrays import Floats
from sccal.degrade.edits import Bytes
from sccal.logs.decimals import write_decimals
from sccal.logs.reference import STATES, ReferenceRows

_DEGREE_PLACES, _TIME_PLACES = 13, 6
_LATEST_S = 1e12
_STATES = np.array([state.encode() for state in STATES])


def after_both(first: ReferenceRows, second: ReferenceRows) -> ReferenceRows:
    """The reference of a log degraded twice: the fixes before the first fault, and what both together made of them."""
    by_utc = first.utc_s is not None and second.utc_s is not None
    old_s, new_s = (first.utc_s, second.utc_s) if by_utc else (first.t_s, second.t_s)
    assert old_s is not None
    assert new_s is not None
    order = np.argsort(new_s, kind="stable")
    at = order[np.minimum(np.searchsorted(new_s[order], old_s - 5e-4), order.size - 1)]
    there = np.abs(new_s[at] - old_s) < 1e-3
    lost = first.lost | ~there | second.lost[at]
    return replace(first, lost=lost, displaced=~lost & (first.displaced | second.displaced[at]))


def reference_text(rows: ReferenceRows) -> bytes:
    """The file's bytes."""
    header = b"t,lat_deg,lon_deg,quality,state" + (b",utc_s" if rows.utc_s is not None else b"") + b"\n"
    states = np.ascontiguousarray(_STATES[rows.state]).view(np.uint8).reshape(rows.lost.size, _STATES.itemsize)
    columns = [
        _numbers(rows.t_s, _TIME_PLACES),
        _numbers(rows.lat_deg, _DEGREE_PLACES),
        _numbers(rows.lon_deg, _DEGREE_PLACES),
        _numbers(rows.quality.astype(np.float64), 0),
        states,
    ]
    if rows.utc_s is not None:
        columns.append(_numbers(rows.utc_s, _TIME_PLACES))
    comma = np.full((rows.lost.size, 1), ord(","), dtype=np.uint8)
    between = [part for column in columns for part in (column, comma)][:-1]
    table = np.hstack([*between, np.full_like(comma, ord("\n"))]).ravel()
    body: bytes = table[table != 0].tobytes()
    return header + body


def _numbers(values: Floats, places: int) -> Bytes:
    known = np.isfinite(values) & (np.abs(values) < _LATEST_S)
    mantissa = np.round(np.abs(np.where(known, values, 0.0)) * 10.0**places).astype(np.int64)
    whole = np.ones(values.size, dtype=np.int64)
    text = write_decimals(
        mantissa, values < 0, whole, np.full(values.size, places), np.zeros(values.size, dtype=np.bool_)
    )
    text[~known] = 0
    return text
