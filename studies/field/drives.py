"""Drives as lists of pieces: so many seconds at a speed and a turn rate."""

from __future__ import annotations

import math

from studies.arrays import stream

Piece = tuple[float, float, float]
"""Seconds, metres per second forward, radians per second to the left."""


def varied(seconds: float, seed: int, speed: float = 0.8, rate: float = 0.5, reverse: bool = True) -> list[Piece]:
    """Straights at two speeds, arcs and spins both ways, stops and some reverse, in an order drawn from the seed.

    Every kind of piece comes once before any comes again, so that short drives show everything too.
    """
    rng = stream(seed, "field drive")
    pieces: list[Piece] = [(6.0, 0.0, 0.0)]
    bag: list[str] = []
    while sum(piece[0] for piece in pieces) < seconds:
        if not bag:
            bag = ["fast", "slow", "arc left", "arc right", "spin left", "spin right", "stop", "fast"]
            bag += ["back"] if reverse else []
            rng.shuffle(bag)
        kind = bag.pop()
        lasts, share = float(rng.uniform(5.0, 9.0)), float(rng.uniform(0.5, 1.0))
        pieces.append(
            {
                "fast": (1.4 * lasts, speed, 0.0),
                "slow": (1.2 * lasts, 0.45 * speed, 0.0),
                "arc left": (lasts, speed * share, rate * share),
                "arc right": (lasts, speed * share, -rate * share),
                "spin left": (lasts, 0.0, rate),
                "spin right": (lasts, 0.0, -rate),
                "stop": (3.0, 0.0, 0.0),
                "back": (lasts, -0.5 * speed, 0.0),
            }[kind]
        )
    return [*pieces, (3.0, 0.0, 0.0)]


def rows(count: int, length_m: float, speed: float, rate: float) -> list[Piece]:
    """Straight rows there and back, with half turns in place on alternate sides."""
    pieces: list[Piece] = [(5.0, 0.0, 0.0)]
    for number in range(count):
        side = 1.0 if number % 2 == 0 else -1.0
        pieces += [(length_m / speed, speed, 0.0), (math.pi / rate, 0.0, side * rate)]
    return [*pieces, (5.0, 0.0, 0.0)]


def headlands(count: int, length_m: float, speed: float, arc_speed: float = 1.4, rate: float = 0.32) -> list[Piece]:
    """Rows of a field with half circles at the headlands, all driven at one speed of turning; a little reverse."""
    pieces: list[Piece] = [(6.0, 0.0, 0.0)]
    for number in range(count):
        side = 1.0 if number % 2 == 0 else -1.0
        pieces += [(length_m / speed, speed, 0.0), (math.pi / rate, arc_speed, side * rate)]
        if number % 3 == 2:
            pieces += [(10.0, 1.0, 0.0), (5.0, -0.8, 0.0)]
    return [*pieces, (4.0, 0.0, 0.0)]


def spins(count: int, straights: int = 0) -> list[Piece]:
    """Turns on the spot both ways, and no more than some short straights."""
    lap: list[Piece] = [(9.0, 0.0, 0.5), (2.0, 0.0, 0.0), (9.0, 0.0, -0.5), (2.0, 0.0, 0.0), (8.0, 0.0, 0.25)]
    return [(5.0, 0.0, 0.0), *(lap * count), *([(6.0, 0.5, 0.0), (3.0, 0.0, 0.0)] * straights), (4.0, 0.0, 0.0)]


def road(seconds: float, seed: int, slowest: float = 5.0) -> list[Piece]:
    """A car on roads: straights and bends at four speeds."""
    rng = stream(seed, "field road")
    pieces: list[Piece] = [(6.0, 0.0, 0.0)]
    while sum(piece[0] for piece in pieces) < seconds:
        speed = slowest * float(rng.choice([1.0, 1.6, 2.2, 3.0]))
        side = float(rng.choice([-1.0, 1.0]))
        pieces.append((float(rng.uniform(8.0, 14.0)), speed, 0.0))
        pieces.append((float(rng.uniform(4.0, 7.0)), min(speed, 1.4 * slowest), side * float(rng.uniform(0.15, 0.3))))
        pieces.append((float(rng.uniform(5.0, 9.0)), speed, side * float(rng.uniform(0.0, 0.08))))
    return [*pieces, (5.0, 0.0, 0.0)]
