"""``python -m benchmarks``: everything that is timed, in turn; ``python -m benchmarks.messages`` times a part of it."""

from benchmarks import batch, degrade, messages, pipeline

for part in (pipeline, messages, degrade, batch):
    part.main()
    print()
