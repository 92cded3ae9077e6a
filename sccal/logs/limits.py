"""Bounds of what a log can mean. A number beyond them is damage or another unit, whatever file it stands in."""

from __future__ import annotations

TIME_LIMIT_S = 1e11
"""Unix time in the year 5138. Milliseconds and nanoseconds since 1970 lie beyond."""
TICKS_LIMIT = 2.0**63
ANGLE_LIMIT_RAD = 1e9
"""A wheel of 0.08 m goes twice around the Earth."""
TURN_LIMIT_RAD = 6.3
"""Pitch and roll: a full turn, and its rounding."""
TURN_RATE_LIMIT_RADPS = 1e4
HEIGHT_LIMIT_M = 1e5
SIGMA_LIMIT_M = 1e5
"""Larger sigmas say no more than this one does: the fix weighs nothing."""
SIGMA_LIMIT_RAD = 100.0
SPEED_LIMIT_MPS = 1e4
"""Over ground, as receivers state it."""
WHEEL_RADIUS_M = (1e-3, 10.0)
TRACK_M = (1e-2, 100.0)
TICKS_PER_REV = (1e-3, 1e9)
UNPACKED_RATIO = 200
"""A compressed log is not so many times larger when unpacked: repeated rows reach about a hundred."""
UNPACKED_FREE_BYTES = 64 << 20
"""What any compressed file may unpack to besides."""
UNPACKED_LIMIT_BYTES = 4 << 30
"""What none may."""
UNPACKING_MEMORY_BYTES = 256 << 20
"""For what a decompressor has to remember; the common tools ask for a quarter of it at most."""
