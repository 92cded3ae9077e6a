"""``python -m sccal``."""

from sccal.cli import main

main()
