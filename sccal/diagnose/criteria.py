"""What makes an effect a finding: each number once, with what it decides and where it comes from.

What an effect costs at all stands with the evidence (PRICE_NATS in sccal.evidence.posterior), and from when on a log
contradicts its noise with the model (CONTRADICTED in sccal.evidence.model), since a calibration asks for both too.

`make study-effects` and `make study-noise` measure the rates of false and missed findings that they buy.
"""

from __future__ import annotations

LEAST_NATS = 8.0
"""What a finding must bring: odds of 3000 to 1 for it, after its price. With fifty candidates that is meant to leave
less than one false finding in a hundred logs."""

LEAST_T = 4.5
"""What a finding must be over its own sigma, stretches and runs counted as clusters: of fifty values with normal errors
the largest passes 4.5 once in 3000 logs. The evidence alone would let a small prior pass for a small error."""

SEARCH_NATS = 10.0
"""Price of a moment or a place: the logarithm of the some ten thousand distinguishable ones that a run offers."""

SEARCH_T = 6.0
"""A moment over its own sigma: the largest of ten thousand tries reaches 4.3 by chance, and a search picks it."""

ALIKE_NATS, ALIKE_SHARE = 3.0, 0.04
"""Models whose evidence is this near, in nats or as a share of what the effect brings, are not told apart: odds of
20 to 1; and columns that are linear hold their effects to a few per cent only."""

PATTERN_NATS = 12.0
"""What a pattern without a name must bring to be told: forty of them look for what is left, each in up to six forms."""

BEYOND_SIGMAS = 6.75
"""A size beyond which a log would have shown an effect: half as much again as LEAST_T, so that it seldom misses."""

CLEARLY_LESS = 0.9
"""Of a drift: less than that is clearly less. The rms of some thirty windows is known to about a tenth."""
