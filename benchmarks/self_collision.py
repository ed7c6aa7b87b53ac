"""Self-collision against meshes: random configurations of robots of example-robot-data.

    python benchmarks/self_collision.py [NAME ...] [--count 10000] [--margin 0.001]

For each robot: `touching` configurations, in which meshes that are not adjacent overlap (read by trimesh, tested by
coal's trees); `missed`: those of them that `Clearance` calls clear, and those in which it overestimates a distance
below the margin; `free` configurations, in which no meshes are nearer than the margin; `refused`: those of them whose
least distance is below the margin. Goals: nothing missed; at most 2 % refused. Pairs that overlap somewhere, but that
`Clearance` does not check, are `left out`.
"""

from __future__ import annotations

import argparse
import sys
import sysconfig
import time
import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin

import cinegen
from cinegen.collision import Clearance
from cinegen.collision.self_collision import PairReason, link_pairs

sys.path.insert(0, str(Path(__file__).parent.parent / "tests/helpers"))
from mesh_contact import MeshContact

ROBOTS = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data/robots"


def configurations(mechanism: cinegen.Mechanism, count: int, seed: int) -> list[np.ndarray]:
    """Configurations within the limits, uniform; angles without limits within half a revolution."""
    model = mechanism.model.copy()
    low, high = model.lowerPositionLimit, model.upperPositionLimit
    far = 1.0 if mechanism.floating else np.pi
    model.lowerPositionLimit, model.upperPositionLimit = np.maximum(low, -far), np.minimum(high, far)
    pin.seed(seed)
    return [pin.randomConfiguration(model) for _ in range(count)]


def judged(path: Path, count: int, margin: float) -> str:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mechanism = cinegen.load(path, ignore_loops=True)
    if not len(mechanism.collision.geometryObjects) or mechanism.model.nv == 0:
        return "no shapes, or no joints"
    meshes = MeshContact(mechanism, configurations(mechanism, 500, 1))
    links = mechanism.derived(link_pairs)
    clearance = Clearance(mechanism, links.bodies, (), links.of(PairReason.CHECKED), 2.0 * margin)
    touching = missed = free = refused = 0
    spent, left_out = 0.0, set()
    for q in configurations(mechanism, count, 2):
        start = time.thread_time()
        least = clearance.least(q)
        spent += time.thread_time() - start
        contact = meshes.touching(q, first=least <= 0.0)
        if contact:
            touching += 1
            if least > 0.0:
                missed += 1
                left_out |= {f"{meshes.names[i]}-{meshes.names[k]}" for i, k in contact}
        elif least >= margin:
            free += 1
            if meshes.touching(q, margin - 1e-6, first=True):
                missed += 1
        elif not meshes.touching(q, margin, first=True):
            free += 1
            refused += 1
    share = refused / free if free else 0.0
    more = f"  left out: {', '.join(sorted(left_out))}" if left_out else ""
    return f"{touching:8} {missed:7} {free:7} {refused:7} {100 * share:6.2f} % {1e6 * spent / count:7.0f} us{more}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="parts of the files' names; all by default")
    parser.add_argument("--after", default="", help="only robots behind this one in the listing")
    parser.add_argument("--count", type=int, default=10000)
    parser.add_argument("--margin", type=float, default=1e-3, help="m")
    given = parser.parse_args()
    print(f"{'robot':<40}{'touching':>8} {'missed':>7} {'free':>7} {'refused':>7}            update")
    paths = sorted(ROBOTS.rglob("*.urdf"))
    behind = max((i + 1 for i, path in enumerate(paths) if path.stem == given.after), default=0)
    for path in paths[behind:]:
        if given.names and not any(name in path.name for name in given.names):
            continue
        try:
            text = judged(path, given.count, given.margin)
        except cinegen.CinegenError as error:
            text = f"can't be loaded: {str(error)[:60]}"
        print(f"{path.stem:<40}{text}", flush=True)


if __name__ == "__main__":
    main()
