"""``python -m benchmarks``: all that is timed, one after the other; ``python -m benchmarks.messages`` times one alone."""

from benchmarks import degrade, messages, pipeline

for part in (pipeline, messages, degrade):
    part.main()
    print()
