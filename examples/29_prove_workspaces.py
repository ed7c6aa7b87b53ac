"""Prove workspaces of a five-bar, a delta and a Gough platform: from the question to a certificate."""

# %% The questions: does the robot reach *every* pose of a region, on one branch, within its limits, not singular?
import json
import math
import tempfile
from pathlib import Path

import cinegen
from cinegen.plotting.proof import draw_proof
from cinegen.proof import load_proof

folder, turn = Path(tempfile.mkdtemp()), math.radians(5.0)
questions = {
    "five_bar": {"over": {"x": (-0.08, 0.08), "y": (0.4, 0.55)}},  # a rectangle, m
    "delta4": {"over": {"x": (-0.15, 0.15), "y": (-0.15, 0.15), "z": (-2.6, -2.4)}, "shape": "cylinder"},
    "gough": {  # six coordinates: no leg gets too short or too long
        "over": {
            "x": (-0.03, 0.03), "y": (-0.03, 0.03), "z": (0.87, 0.93),
            "rx": (-turn, turn), "ry": (-turn, turn), "rz": (-turn, turn),
        }
    },
}  # fmt: skip

# %% The answers are those of an independent checker of each certificate; anyone can have it checked again.
for name, question in questions.items():
    proof = cinegen.prove(cinegen.load(name), limits=True, **question)
    certificate = folder / f"{name}-proof.json"
    certificate.write_text(json.dumps(proof.certificate))
    print(f"{name}: {load_proof(certificate).message}")

# %% How far can the five-bar's tool go? What is out of reach is refuted; along its edge, boxes stay undecided.
beyond = {"x": (-0.2, 0.2), "y": (0.3, 0.7)}
larger = cinegen.prove(cinegen.load("five_bar"), beyond, limits=True, boxes=400)
print(f"five_bar, a larger rectangle: {larger.message}")
draw_proof(larger, name="five_bar").savefig(folder / "five_bar.png", dpi=150)

# %% The largest disc about the middle of the rectangle that is proved, up to 1 %.
disc = cinegen.prove(cinegen.load("five_bar"), {"x": (-0.1, 0.1), "y": (0.375, 0.575)}, shape="ball", grow=True)
print(f"five_bar, the largest disc: {disc.region_text}")
