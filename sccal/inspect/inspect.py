"""One log inspected: what is there, how good it is, what the robot did, and what that can show."""

from __future__ import annotations

import numpy as np

from sccal.align import align
from sccal.errors import DataError
from sccal.inspect.coverage import stream_facts
from sccal.inspect.drive import drive_facts, motion, series, standstill_facts
from sccal.inspect.excitation import excited_by_pass, excited_by_shape
from sccal.inspect.findings import findings
from sccal.inspect.fixes import fix_facts, range_of
from sccal.inspect.read import LogStreams, read_streams
from sccal.inspect.together import bring_together
from sccal.inspect.verdict import judged_log
from sccal.inspect.witnesses import course_facts, witnesses
from sccal.logs.names import AHRS_FILE, ENCODER_FILE, NMEA_FILE
from sccal.logs.options import ReadOptions
from sccal.logs.run import RunSource
from sccal.logs.streams import Notice
from sccal.results.inspection import ColumnFacts, Excited, Inspection

BY_PASS = "one pass of the filter's sensitivities at typical noise"
BY_SHAPE = "rules of thumb about the shape of the drive, because the log cannot be calibrated as it is"
_RECEIVER_COLUMNS = {"hdop", "satellites", "age_s"}


def inspect_run(source: RunSource, options: ReadOptions | None = None) -> Inspection:
    """Inspect one run, whatever of it can be read; options are for logs of messages.

    Raises DataError where nothing can be read.
    """
    streams = read_streams(source, options)
    if streams.nothing:
        raise DataError("; ".join(one.why for one in streams.unread) or f"{source.path}: nothing to read")
    together = bring_together(streams)
    facts = stream_facts(streams, together)
    moved = motion(together)
    drive = drive_facts(together, moved, 1.0 if streams.vehicle is None else streams.vehicle.track_m)
    seen = witnesses(together, streams.vehicle if streams.declared else None)
    course = course_facts(together)
    fixes = None
    if streams.fixes is not None and together.fixes is not None:
        fixes = fix_facts(streams.fixes, together.fixes, together.span_s)
    excited, refusal, doubts = _calibrated(streams)
    how = BY_PASS
    if not excited and drive is not None:
        excited, how = excited_by_shape(drive), BY_SHAPE
    return judged_log(
        Inspection(
            run=source.name,
            path=source.path,
            vehicle=streams.vehicle,
            declared=streams.declared,
            unread=streams.unread,
            span_s=together.span_s,
            streams=facts,
            fixes=fixes,
            clock=together.clock,
            drive=drive,
            standstill=standstill_facts(together, moved),
            witnesses=seen,
            course=course,
            columns=_columns(streams),
            excited=excited,
            excited_how=how,
            findings=findings(streams, together, facts, fixes, drive, seen, course, refusal, doubts),
            notices=(*streams.notices, *doubts),
            series=series(together, moved),
        )
    )


def _calibrated(streams: LogStreams) -> tuple[tuple[Excited, ...], str, tuple[Notice, ...]]:
    """What a calibration would say before it estimates anything: what is shown, why it would refuse, its warnings."""
    run = streams.run
    if run is None:
        return (), "", ()
    try:
        aligned = align(run)
    except DataError as error:
        return (), str(error), ()
    doubts = aligned.notices[len(run.notices) :]
    try:
        return excited_by_pass(aligned), "", doubts
    except DataError as error:
        return (), str(error), doubts


def _columns(streams: LogStreams) -> tuple[ColumnFacts, ...]:
    """The further columns; what every receiver says about itself is told with the fixes."""
    found = []
    for source, stream in (
        (ENCODER_FILE, streams.wheels),
        (AHRS_FILE, streams.heading),
        (streams.fix_source, streams.fixes),
    ):
        if stream is None:
            continue
        for name, values in stream.extras.items():
            shown = range_of(values)
            if shown is None or (source == NMEA_FILE and name in _RECEIVER_COLUMNS):
                continue
            found.append(ColumnFacts(source, name, shown, shown.high > shown.low, float(np.isnan(values).mean())))
    return tuple(found)
