"""Checks of certificates that processes share."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from cinegen.cluster import connected, each, processes
from cinegen.proof.checker import BoxResult, Spread, check, one_by_one

_WORTH = 200  # boxes for each process, from which on processes are worth starting

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
        claimed = sum(isinstance(node, dict) and "x" in node for node in certificate["tree"]) - len(findings or ())
        with self._spread(claimed) as spread:
            return check(certificate, self._checked, dropped, findings, spread)

    def _checked(self, done: int, total: int) -> None:
        if self._report is not None:
            self._report("checking", done, total)

    @contextmanager
    def _spread(self, claimed: int) -> Iterator[Spread]:
        count = processes(self._workers, self._scheduler, claimed // _WORTH)
        if self._scheduler is None and count == 1:
            yield one_by_one
            return
        with connected(self._scheduler, count) as client:
            yield lambda function, tasks, data: (
                (task, future.result()) for task, future in each(client, function, tasks, data)
            )
