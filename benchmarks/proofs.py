"""Proofs of workspaces: boxes, seconds until the answer with its certificate, and processor seconds of the check alone.

python benchmarks/proofs.py [CASE ...]   # all cases, unless some are named
"""

from __future__ import annotations

import math
import sys
import time

import cinegen
from cinegen.design import Parameters, WithinTolerances
from cinegen.proof import check

TEN = math.radians(10.0)
GOUGH = {"x": (-0.1, 0.1), "y": (-0.1, 0.1), "z": (0.8, 1.0)} | dict.fromkeys(("rx", "ry", "rz"), (-TEN, TEN))
FIVE_BAR = {"x": (-0.08, 0.08), "y": (0.4, 0.55)}
DELTA = {"x": (-0.1, 0.1), "y": (-0.1, 0.1), "z": (-2.56, -2.44)}
CASES = {
    "five_bar": ("five_bar", FIVE_BAR, {"limits": True}),
    "five_bar, 0.05 mm": ("five_bar", FIVE_BAR, {"tolerances": "0.05mm"}),
    "five_bar, apart": ("five_bar", FIVE_BAR, {"clearance": 0.19}),
    "delta4": ("delta4", DELTA, {"limits": True}),
    "delta4, 0.05 mm": ("delta4", DELTA, {"limits": True, "tolerances": "0.05mm"}),
    "delta4, apart": ("delta4", DELTA, {"clearance": 0.45}),
    "gough, 3 coordinates": ("gough", {"x": (-0.2, 0.2), "y": (-0.2, 0.2), "z": (0.7, 1.1)}, {}),
    "gough, 6 coordinates": ("gough", GOUGH, {}),
    "gough, 6 with sigma": ("gough", GOUGH, {"sigma": 0.0515}),
}
"""Robot, region (m and rad), and what is asked. 0.0515 is half of the least singular value at sampled poses."""


def main(names: list[str]) -> None:
    for name in names or CASES:
        robot, over, asked = CASES[name]
        mechanism = cinegen.load(robot)
        if "tolerances" in asked:
            parameters = Parameters(robot)
            mechanism = parameters.mechanism
            asked = {**asked, "tolerances": WithinTolerances(parameters, {"link*.d": asked["tolerances"]})}
        cinegen.prove(
            mechanism, {key: (0.99 * a + 0.01 * b, 0.98 * a + 0.02 * b) for key, (a, b) in over.items()}, boxes=1
        )
        start = time.perf_counter()
        proof = cinegen.prove(mechanism, over, **asked)
        answered, start = time.perf_counter() - start, time.process_time()
        check(proof.certificate)
        checked = time.process_time() - start
        text = f"{answered:6.2f} s, check {checked:6.2f} s of CPU"
        print(f"{name:22} {100 * proof.proved:5.1f} % {proof.boxes:4} boxes {text}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
