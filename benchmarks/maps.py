"""How fast maps are made, from evaluation to file, and what it costs to share the work.

    python benchmarks/maps.py [ROUNDS] [--quick]

Each row is a ratio of two ways that take turns: the medians of all rounds stand beside each other.
"""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median

from bench import PANDA

import cinegen
from cinegen.cluster import connected, each
from cinegen.ik.batch import evaluate
from cinegen.workspace import GridAxis, MapSpecification, Region, make_map
from cinegen.workspace.chunks import back_and_forth

BATCH = 20_000  # configurations that `evaluate` gets at once
TASKS = 500  # that do nothing


def over(mechanism: cinegen.Mechanism, names: Sequence[str], side: int, node: str = "") -> MapSpecification:
    """A map over motors, about home."""
    home = {name: float(mechanism.q_home[mechanism.q_index(name)]) for name in names}
    axes = tuple(GridAxis(name, home[name] - 0.4, home[name] + 0.4, side) for name in names)
    return MapSpecification(mechanism, Region(axes), node=node, limits=False)


def alone(spec: MapSpecification) -> float:
    """Evaluations a second of `cinegen.evaluate`, at the same configurations."""
    region = spec.region
    values = region.joint_values(spec.mechanism, region.values(tuple(slice(0, n) for n in region.shape)))
    values = values[back_and_forth(list(region.shape))]
    begin = time.perf_counter()
    for first in range(0, len(values), BATCH):
        evaluate(spec.mechanism, spec.node, values[first : first + BATCH], *spec.counted)
    return len(values) / (time.perf_counter() - begin)


def whole(spec: MapSpecification) -> float:
    """Cells a second of a map made by this process, from the call to the open file."""
    with tempfile.TemporaryDirectory() as folder:
        begin = time.perf_counter()
        make_map(spec, Path(folder) / "map.zarr", workers=1)
        return spec.region.size / (time.perf_counter() - begin)


def steady(spec: MapSpecification, scheduler: str | None, skipped: int = 4) -> float:
    """Cells a second of a map, once it is under way."""
    with tempfile.TemporaryDirectory() as folder:
        progress: list[tuple[float, int]] = []
        make_map(spec, Path(folder) / "map.zarr", workers=1, scheduler=scheduler,
                 report=lambda done, _: progress.append((time.perf_counter(), done)))  # fmt: skip
        (first, before), (last, after) = progress[skipped], progress[-1]
        return (after - before) / (last - first)


def turns(rounds: int, *measures: Callable[[], float]) -> list[float]:
    """Medians of measures that take turns."""
    rates = [[way() for way in measures] for _ in range(rounds)]
    return [median(values) for values in zip(*rates, strict=True)]


def row(what: str, first: float, second: float, unit: str, mark: str = "") -> None:
    print(f"{what:<62}{first:>10,.0f}{second:>10,.0f} {unit:<4}{second / first:>6.2f}  {mark}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("rounds", nargs="?", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="smaller maps")
    arguments = parser.parse_args()
    rounds, quick = arguments.rounds, arguments.quick
    warnings.simplefilter("ignore")  # the panda's second finger
    panda, delta = cinegen.load(PANDA), cinegen.load("delta4")
    specifications = {
        "panda": over(panda, panda.actuated[:6], 8 if quick else 10, "panda_hand"),
        "delta4": over(delta, delta.actuated, 50 if quick else 70),
    }
    marks = {"panda": ">= 300,000 /s", "delta4": ">= 50,000 /s"}
    print(f"{'':<62}{'first':>10}{'second':>10}{'ratio':>11}  mark")
    with connected(None, 1) as single, connected(None, 2) as two:
        addresses = [str(client.scheduler.address) for client in (single, two)]  # type: ignore[union-attr]
        for name, spec in specifications.items():
            whole(spec)
            rates = turns(rounds, lambda s=spec: alone(s), lambda s=spec: whole(s))
            row(f"{name}: evaluate alone; a map, from the call to the file", *rates, "/s", marks[name])
            measures = [lambda s=spec, at=at: steady(s, at) for at in (None, *addresses)]
            inside, shared, both = turns(rounds, *measures)
            row(f"{name}: this process; one process by Dask", inside, shared, "/s", ">= 0.95")
            row(f"{name}: one process by Dask; two", shared, both, "/s", ">= 1.8")
        begin = time.perf_counter()
        for _ in each(single, abs, range(TASKS)):
            pass
        print(f"a task that does nothing: {1e3 * (time.perf_counter() - begin) / TASKS:.2f} ms")


if __name__ == "__main__":
    main()
