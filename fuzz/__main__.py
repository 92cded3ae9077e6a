"""``python -m fuzz --seconds N [--reader NAME]``: hunt in every reader for N seconds in all, and keep what is found.

Each reader gets a process with limits of time and memory. What is found is made small and put into
``tests/corpus/<reader>/``, where ``tests/test_corpus.py`` reads it ever after. Exit code 1 where anything was found.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from fuzz.minimise import minimised
from fuzz.readers import READERS

CORPUS = Path(__file__).parent.parent / "tests" / "corpus"
WEIGHTS = {"vehicle": 0.5, "reference": 0.5, "mcap": 2.0, "nmea": 2.0, "align": 2.0}
"""Shares of the time that are not 1."""


def main() -> int:
    """Hunt, and tell."""
    parser = argparse.ArgumentParser(prog="python -m fuzz", description="Fuzz the readers.")
    parser.add_argument("--seconds", type=float, default=60.0, help="for all readers together")
    parser.add_argument("--reader", action="append", choices=sorted(READERS), help="only this one (repeatable)")
    parser.add_argument("--work", type=Path, help="folder for the growing corpora; temporary without it")
    chosen = parser.parse_args()
    names = chosen.reader or list(READERS)
    whole = sum(WEIGHTS.get(name, 1.0) for name in names)
    found = 0
    with tempfile.TemporaryDirectory() as temporary:
        for name in names:
            seconds = max(1, round(chosen.seconds * WEIGHTS.get(name, 1.0) / whole))
            found += hunted(name, seconds, (chosen.work or Path(temporary)) / name)
    return 1 if found else 0


def hunted(name: str, seconds: int, folder: Path) -> int:
    """Hunt in one reader; how many different failures were found."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in (*folder.glob("found-*"), *folder.glob("killed-*"), folder / "counts.json"):
        old.unlink(missing_ok=True)
    end = time.monotonic() + seconds
    runs = read = 0
    while (left := round(end - time.monotonic())) > 0:
        command = [sys.executable, "-m", "fuzz.hunt", name, str(left), str(folder)]
        with (folder / "log.txt").open("ab") as log:
            subprocess.run(command, stdout=log, stderr=log, check=False)
        counts = folder / "counts.json"
        if not counts.exists():
            print(f"{name:14} the hunt did not start; see {folder}/log.txt", file=sys.stderr)
            print((folder / "log.txt").read_text(errors="replace")[-2000:], file=sys.stderr)
            return 1
        counted = json.loads(counts.read_text())
        runs, read = runs + counted["runs"], read + counted["read"]
        counts.unlink()
    finds = sorted([*folder.glob("found-*[!t]"), *folder.glob("killed-*")])
    finds = [path for path in finds if path.suffix != ".txt"]
    print(f"{name:14} {runs:8} inputs in {seconds} s, {read} of them read, {len(finds)} failures", flush=True)
    for path in finds:
        data = path.read_bytes() if path.name.startswith("killed-") else minimised(name, path.read_bytes())
        kept = CORPUS / name / hashlib.sha256(data).hexdigest()[:12]
        kept.parent.mkdir(parents=True, exist_ok=True)
        kept.write_bytes(data)
        story = path.with_suffix(path.suffix + ".txt")
        last = story.read_text(errors="replace").strip().splitlines()[-1][:300] if story.exists() else "killed"
        print(f"  {path.name}: {len(data)} bytes -> {kept.relative_to(CORPUS.parent.parent)}\n    {last}", flush=True)
    return len(finds)


if __name__ == "__main__":
    sys.exit(main())
