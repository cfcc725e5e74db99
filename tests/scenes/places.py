"""Where the repository lies, and the real surveys beside it (not there on every machine)."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
REAL = ROOT.parent / "shared" / "data"
