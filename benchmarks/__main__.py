"""``python -m benchmarks``: everything that is timed, in turn; ``python -m benchmarks.messages`` times a part of it."""

from benchmarks import degrade, messages, pipeline

for part in (pipeline, messages, degrade):
    part.main()
    print()
