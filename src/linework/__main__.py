"""``python -m linework`` is the command ``linework``."""

from __future__ import annotations

import sys

from linework.cli.app import main

if __name__ == "__main__":
    sys.exit(main())
