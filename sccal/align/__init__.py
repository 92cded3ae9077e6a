"""Streams to one timeline of events: one clock, one plane, one heading convention, checked against each other."""

from sccal.align.aligned import Aligned, Series, align
from sccal.align.timeline import Timeline, build_timeline, clear_steps
from sccal.results.clock import Clock

__all__ = ["Aligned", "Clock", "Series", "Timeline", "align", "build_timeline", "clear_steps"]
