"""Platforms on legs are built as the tests of assembly modes build theirs."""

import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent.parent / name) for name in ("assembly", "robots")]
