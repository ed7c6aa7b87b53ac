"""How often `plan` leaves traps and passes gaps in the plane, and how long its paths are by the shortest ones.

    python benchmarks/shortest_paths.py [COUNT] [--first NUMBER] [--seconds S]

Families of random scenes of a disc (0.1 m in radius) among boxes, in a room:

    trap    the disc is inside of a U of random size that opens away from the goal
    gap     two walls across the room with one gap each, 1 to 10 cm wider than the disc and its safety distances

The shortest path is that of a grid (2 cm, 32 directions; Dijkstra's algorithm in scipy) on distances from the boxes in
closed form, which is at most 2 % longer than the true optimum.
"""

from __future__ import annotations

import argparse
import math
import time
from statistics import median

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from cinegen.collision import Scene, scene_of
from cinegen.planning import plan

Array = np.ndarray
RADIUS, SAFETY, CELL = 0.1, 0.01, 0.02  # m


def scene(name: str, boxes: list[tuple[Array, Array, float]], start: Array, goal: Array) -> Scene:
    obstacles = [
        {"kind": "box", "size": size.tolist(), "point": point.tolist(), "angle": angle} for point, size, angle in boxes
    ]
    return scene_of(
        {
            "name": name, "mobile": {"radius": RADIUS}, "safety": SAFETY, "obstacle": obstacles,
            "start": {"point": start.tolist()}, "goal": {"point": goal.tolist()},
        }
    )  # fmt: skip


def trap(number: int) -> tuple[Scene, list[tuple[Array, Array, float]]]:
    rng = np.random.default_rng(number)
    width, depth, angle, wall = rng.uniform(0.6, 2.0), rng.uniform(0.6, 2.0), rng.uniform(-np.pi, np.pi), 0.1
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    local = [
        ([0.0, 0.0], [wall, width + 2 * wall]),
        *(([-depth / 2, side * (width + wall) / 2], [depth + wall, wall]) for side in (-1.0, 1.0)),
    ]
    boxes = [(turn @ np.array(point), np.array(size), angle) for point, size in local]
    start = turn @ np.array([-rng.uniform(0.2, depth), rng.uniform(-0.5, 0.5) * (width - 0.4)])
    goal = turn @ np.array([rng.uniform(0.3, 2.0), rng.uniform(-0.5, 0.5) * width])
    return scene(f"trap {number}", boxes, start, goal), boxes


def gap(number: int) -> tuple[Scene, list[tuple[Array, Array, float]]]:
    rng, boxes = np.random.default_rng(number), []
    for x in (-0.8, 0.8):
        centre, half = rng.uniform(-1.2, 1.2), RADIUS + SAFETY + rng.uniform(0.005, 0.05)
        for low, high in ((-2.0, centre - half), (centre + half, 2.0)):
            boxes.append((np.array([x, (low + high) / 2]), np.array([0.1, high - low]), 0.0))
    boxes += [(np.array([0.0, y]), np.array([4.2, 0.1]), 0.0) for y in (-2.05, 2.05)]
    boxes += [(np.array([x, 0.0]), np.array([0.1, 4.2]), 0.0) for x in (-2.05, 2.05)]
    start, goal = (np.array([x, rng.uniform(-1.5, 1.5)]) for x in (-1.5, 1.5))
    return scene(f"gap {number}", boxes, start, goal), boxes


def distances(points: Array, boxes: list[tuple[Array, Array, float]]) -> Array:
    """(n,) from points (n, 2) to the nearest box."""
    found = np.full(len(points), np.inf)
    for point, size, angle in boxes:
        c, s = math.cos(angle), math.sin(angle)
        inside = (points - point) @ np.array([[c, -s], [s, c]])
        found = np.minimum(found, np.linalg.norm(np.maximum(np.abs(inside) - size / 2.0, 0.0), axis=1))
    return found


def shortest(boxes: list[tuple[Array, Array, float]], start: Array, goal: Array) -> float:
    """Length of the grid's shortest path, m; infinite if there is none."""
    corners = np.array([start, goal, *(point for point, _, _ in boxes)])
    reach = 0.5 + max(float(np.linalg.norm(size)) for _, size, _ in boxes) / 2.0
    low, high = corners.min(axis=0) - reach, corners.max(axis=0) + reach
    nx, ny = (np.ceil((high - low) / CELL).astype(int) + 1).tolist()
    x, y = np.meshgrid(low[0] + CELL * np.arange(nx), low[1] + CELL * np.arange(ny), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel()])
    free = (distances(points, boxes) >= RADIUS + SAFETY).reshape(nx, ny)
    index, rows, columns, costs = np.arange(nx * ny).reshape(nx, ny), [], [], []
    steps = [(a, b) for a in range(-4, 5) for b in range(-4, 5) if math.gcd(a, b) == 1 and (a, b) > (0, 0)]
    for a, b in steps:
        one = (slice(max(0, -a), nx - max(0, a)), slice(max(0, -b), ny - max(0, b)))
        other = (slice(max(0, a), nx - max(0, -a)), slice(max(0, b), ny - max(0, -b)))
        both = free[one] & free[other]
        if max(abs(a), abs(b)) > 1:  # a long step may cut a corner by less than a millimetre
            middle = (points[index[one]] + points[index[other]]) / 2.0
            both &= (distances(middle.reshape(-1, 2), boxes) >= RADIUS + SAFETY).reshape(both.shape)
        rows.append(index[one][both])
        columns.append(index[other][both])
        costs.append(np.full(int(both.sum()), CELL * math.hypot(a, b)))
    graph = coo_matrix((np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns))), (nx * ny, nx * ny))
    first, last = (int(np.linalg.norm(points - end, axis=1).argmin()) for end in (start, goal))
    return float(dijkstra(graph.tocsr(), directed=False, indices=first)[last])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("count", nargs="?", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, metavar="NUMBER")
    parser.add_argument("--seconds", type=float, default=10.0)
    options = parser.parse_args()
    for make in (trap, gap):
        solved, solvable, ratios, times = 0, 0, [], []
        for number in range(options.first, options.first + options.count):
            made, boxes = make(number)
            optimum = shortest(boxes, made.start, np.array(made.goal.translation[:2]))
            begin = time.process_time()
            found = plan(made, seconds=options.seconds)
            times.append(time.process_time() - begin)
            solvable += math.isfinite(optimum)
            if found:
                solved += 1
                ratios += [found.length / optimum] * math.isfinite(optimum)
            print(
                f"{made.name}: {found.status.value}, {found.length:.2f} m, by the optimum {optimum:.2f} m", flush=True
            )
        print(
            f"{make.__name__}: {solved} solved of {solvable} that the grid solves; length by the shortest path: median "
            f"{median(ratios):.3f}, largest {max(ratios):.3f}; median {median(times):.2f} CPU s"
        )


if __name__ == "__main__":
    main()
