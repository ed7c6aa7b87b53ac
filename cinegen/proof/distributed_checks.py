"""Checks of certificates that processes share, and that go on where they were interrupted."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from typing import Any, TextIO

from cinegen.cluster import connected, each, processes
from cinegen.proof.checker import BoxResult, Spread, check, one_by_one
from cinegen.proof.exported_equations import ProofError

_WORTH = 200, 50  # boxes, without and with singular values, for which a process is worth starting, or a file
_MARK = "examined boxes of cinegen prove"

Report = Callable[[str, int, int], object]


class Checker:
    """Checks certificates, in several processes if they have many boxes.

    Args:
        workers: number of processes; None for one for each core, for many boxes.
        scheduler: address of a Dask scheduler.
        report: see `prove`.
    """

    def __init__(self, workers: int | None, scheduler: str | None, report: Report | None) -> None:
        self._workers, self._scheduler, self._report = workers, scheduler, report

    def result(
        self,
        certificate: Mapping[str, Any],
        dropped: set[int] | None = None,
        findings: dict[int, BoxResult] | None = None,
    ) -> dict[str, Any]:
        """Return the result of a certificate; for arguments see `check`.

        Raises:
            CertificateError: a claim is not confirmed.
            ClusterError: workers can't be started.
        """
        worth = 0
        with suppress(LookupError, TypeError):  # it is damaged: `check` says how
            worth = (_tubes(certificate) - len(findings or ())) // _worth(certificate)
        with self._spread(worth) as spread:
            return check(certificate, self._checked, dropped, findings, spread)

    def _checked(self, done: int, total: int) -> None:
        if self._report is not None:
            self._report("checking", done, total)

    @contextmanager
    def _spread(self, worth: int) -> Iterator[Spread]:
        count = processes(self._workers, self._scheduler, worth)
        if self._scheduler is None and count == 1:
            yield one_by_one
            return
        with connected(self._scheduler, count) as client:
            yield lambda function, tasks, data: (
                (task, future.result()) for task, future in each(client, function, tasks, data)
            )


def _tubes(certificate: Mapping[str, Any]) -> int:
    return sum(isinstance(node, dict) and "x" in node for node in certificate["tree"])


def _worth(certificate: Mapping[str, Any]) -> int:
    return _WORTH[certificate["bounds"]["sigma"] is not None]


@contextmanager
def examined(path: Path | None, certificate: Mapping[str, Any]) -> Iterator[dict[int, BoxResult]]:
    """Yield the boxes of a certificate that were examined; a file keeps them, if they are many, until all are.

    Raises:
        ProofError: the file is of another kind.
    """
    if path is None or _tubes(certificate) < _worth(certificate):
        yield {}
        return
    head = f"{_MARK} {sha256(json.dumps(certificate, sort_keys=True).encode()).hexdigest()}"
    text = path.read_text(errors="replace") if path.exists() else ""
    first, *lines = (text or head).splitlines()  # one that was interrupted at once left an empty file
    if not first.startswith(_MARK):
        raise ProofError(f"{path} is not what an interrupted proof left: move it away, or give another output")
    with path.open("a" if lines and first == head else "w") as file:
        findings = _Kept(file, lines if first == head else [])
        if not findings:
            file.write(head)
        yield findings
    path.unlink()


class _Kept(dict[int, BoxResult]):
    """Results of boxes that are written to a file, too."""

    def __init__(self, file: TextIO, lines: Sequence[str]) -> None:
        super().__init__()
        self._file = file
        for line in lines:
            with suppress(ValueError, TypeError):  # it was not written to its end
                number, *result = json.loads(line)
                super().__setitem__(number, BoxResult(*result))

    def __setitem__(self, number: int, result: BoxResult) -> None:
        super().__setitem__(number, result)
        self._file.write(f"\n{json.dumps([number, *result])}")
        self._file.flush()
