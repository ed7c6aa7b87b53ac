"""Minimise what breaks a promise, by delta debugging (Zeller and Hildebrandt, 2002): of a tree's elements, of lines, of
words, of bytes."""

from __future__ import annotations

import gc
import os
import pickle
import re
import resource
import signal
import time
from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

from lxml import etree

from campaign.judge import limit_memory

Part = TypeVar("Part")


def shrunk(data: bytes, breaks: Callable[[bytes], bool], seconds: float) -> bytes:
    """Return a part of the data, as small as is found in time, that still breaks.

    Args:
        data: that breaks.
        breaks: whether data breaks the same promise.
        seconds: to look for it.
    """
    end = time.monotonic() + seconds
    data = _of_elements(data, breaks, end)
    for pattern in (rb"[^\n]*\n?", rb"\s+|[\w.+-]+|[^\s\w]", rb"."):
        parts = re.findall(pattern, data, re.DOTALL)
        if len(parts) < 3000:
            data = b"".join(least(parts, lambda kept: breaks(b"".join(kept)), end))
    return data


def least(parts: Sequence[Part], breaks: Callable[[Sequence[Part]], bool], end: float = float("inf")) -> Sequence[Part]:
    """Return as few of the parts as break (`ddmin`)."""
    kept, size = list(parts), max(1, len(parts) // 2)
    while kept and time.monotonic() < end:
        at, before = 0, len(kept)
        while at < len(kept) and time.monotonic() < end:
            fewer = kept[:at] + kept[at + size :]
            if breaks(fewer):
                kept = fewer
            else:
                at += size
        if len(kept) == before and size == 1:
            break
        size = max(1, min(size // 2, len(kept) // 2)) if len(kept) == before or size > 1 else 1
    return kept


def _of_elements(data: bytes, breaks: Callable[[bytes], bool], end: float) -> bytes:
    """Leave out elements of XML, outer ones first."""
    try:
        root = etree.fromstring(data)
    except (etree.XMLSyntaxError, ValueError):
        return data
    if not breaks(etree.tostring(root)):
        return data
    for node in list(root.iterdescendants()):
        parent = node.getparent()
        if parent is None or root not in (*node.iterancestors(),) or time.monotonic() > end:
            continue
        at = parent.index(node)
        parent.remove(node)
        if not breaks(etree.tostring(root)):
            parent.insert(at, node)
    return etree.tostring(root)


def in_child(act: Callable[[], Iterable[str]], cpu: float, memory: int) -> set[str]:
    """Return what a function returns in a process of its own; {"died"} if that dies.

    Args:
        act: the function.
        cpu: seconds of CPU that it may take.
        memory: bytes of address space that it may take, besides that of the parent.
    """
    there, here = os.pipe()
    pid = os.fork()
    if pid == 0:
        try:
            gc.freeze()  # else a collection copies all pages of the parent, out of the CPU that it may take
            signal.signal(signal.SIGXCPU, signal.SIG_DFL)
            limit_memory(memory)
            resource.setrlimit(resource.RLIMIT_CPU, (int(time.process_time() + cpu) + 1, resource.RLIM_INFINITY))
            with os.fdopen(here, "wb") as file:
                pickle.dump(set(act()), file)
        finally:
            os._exit(0)
    os.close(here)
    with os.fdopen(there, "rb") as file:
        content = file.read()
    os.waitpid(pid, 0)
    return pickle.loads(content) if content else {"died"}
