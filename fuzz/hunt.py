"""One process that hunts in one reader: ``python -m fuzz.hunt READER SECONDS FOLDER`` (started by the driver).

Atheris (libFuzzer) chooses by coverage; half of the mutations are its own and half know the format. Findings are kept
in FOLDER by their signature, the smallest of each, and the hunt goes on.
"""

from __future__ import annotations

import json
import resource
import sys
import tempfile
import traceback
from pathlib import Path
from random import Random

import atheris

with atheris.instrument_imports(
    include=["sccal.logs", "sccal.align", "rosbags"], exclude=["sccal.align.denoise", "sccal.align.whitening"]
):
    from fuzz.readers import READERS, feed, signature
from fuzz.mutate import mutator_of
from fuzz.seeds import seeds_of

MEMORY_BYTES = 3 << 30
"""Address space above what is mapped at the start."""


def limit_memory() -> None:
    """Let this process have no more than MEMORY_BYTES besides what it has: more raises MemoryError."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + MEMORY_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def hunt(name: str, seconds: int, folder: Path) -> None:
    """Fuzz one reader; ends the process."""
    reader = READERS[name]
    corpus = folder / "corpus"
    corpus.mkdir(parents=True, exist_ok=True)
    for i, seed in enumerate(seeds_of(name)):
        (corpus / f"seed{i}").write_bytes(seed)
    longest = 4 * max(path.stat().st_size for path in corpus.glob("seed*"))
    mutate = mutator_of(name, reader.text)
    scratch = Path(tempfile.mkdtemp(dir="/dev/shm" if Path("/dev/shm").is_dir() else None))
    counts = {"runs": 0, "read": 0}
    every = 1 if reader.limit_s > 30 else 100

    def one(data: bytes) -> None:
        counts["runs"] += 1
        try:
            answer = feed(reader, data, scratch)
            counts["read"] += " " not in answer
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                raise
            keep(folder, signature(error), data, error)
        if counts["runs"] % every == 0:
            (folder / "counts.json").write_text(json.dumps(counts))

    def mutation(data: bytes, most: int, seed: int) -> bytes:
        if data and seed % 2:
            changed = mutate(bytes(data), Random(seed))
            return changed[:most]
        return atheris.Mutate(data, most)

    arguments = [
        "hunt", str(corpus), f"-max_total_time={seconds}", f"-max_len={longest}", "-verbosity=0",
        "-report_slow_units=3600",
        f"-timeout={int(2 * reader.limit_s) + 5}", f"-artifact_prefix={folder}/killed-", "-rss_limit_mb=4096",
    ]  # fmt: skip
    atheris.Setup(arguments, one, custom_mutator=mutation)
    limit_memory()
    atheris.Fuzz()


def keep(folder: Path, name: str, data: bytes, error: BaseException) -> None:
    """Keep a finding unless a smaller one of the same signature is there."""
    path = folder / f"found-{name}"
    if path.exists() and path.stat().st_size <= len(data):
        return
    path.write_bytes(data)
    path.with_suffix(path.suffix + ".txt").write_text("".join(traceback.format_exception(error)))


if __name__ == "__main__":
    hunt(sys.argv[1], int(sys.argv[2]), Path(sys.argv[3]))
