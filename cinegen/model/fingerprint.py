"""Fingerprints: two descriptions with the same one are of the same robot."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any


def fingerprint(urdf: str, constraints: Mapping[str, Any] | None) -> str:
    """Return the SHA-256 over a URDF's text and its constraints."""
    values = json.dumps(constraints, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(f"{urdf}\0{values}".encode()).hexdigest()
