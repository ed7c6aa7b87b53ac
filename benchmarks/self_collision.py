"""Self-collision against meshes: random configurations of robots of example-robot-data, and contacts that are sought.

    python benchmarks/self_collision.py [NAME ...] [--count 10000] [--seconds 20] [--seek 5] [--margin 0.001]

For each robot, in `count` random configurations, or fewer if the CPU time is over:

    touching   meshes that are not adjacent overlap (read by trimesh, tested by coal's trees)
    missed     of these, `Clearance` calls them clear; or it overestimates a distance below the margin
    free       no meshes are nearer than the margin
    refused    of these, `Clearance` finds less than the margin
    sought     contacts that are sought: from a random configuration a pair of meshes approaches by Newton steps on its
               distance until it touches; then the contact is halved until it only grazes. All configurations with
               contact on the way are asked about
    told clear of these, `Clearance` calls them clear
    constant   pairs that are left out because they touch in all sampled configurations, as `info --collision` reports:
               contact of only these is no contact here

Goals: nothing missed or told clear; at most 2 % refused. Pairs in contact that is told clear are named. `<` is the part
of all configurations with contact that may be told clear, if none of n is (95 % confidence). Coal finds contact of
triangles that are up to 1e-6 m apart; the checker is asked about 3e-6 m, the error that its documentation states.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin
from bench import EXAMPLES

import cinegen
from cinegen.collision import Clearance
from cinegen.collision.self_collision import PairReason, link_pairs

sys.path.insert(0, str(Path(__file__).parent.parent / "tests/helpers"))
from mesh_contact import MeshContact

NEWTON, HALVINGS = 25, 20
TOUCH = 3e-6  # m


def within(mechanism: cinegen.Mechanism) -> pin.Model:
    """The model with finite limits: angles without limits within half a revolution."""
    model = mechanism.model.copy()
    far = 1.0 if mechanism.floating else np.pi
    model.lowerPositionLimit = np.maximum(model.lowerPositionLimit, -far)
    model.upperPositionLimit = np.minimum(model.upperPositionLimit, far)
    return model


class Judge:
    """A robot's meshes and its checker.

    `constant` are the pairs of links that are left out because they always touch; `told` those in contact that was told
    clear.
    """

    def __init__(self, path: Path) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self.mechanism = cinegen.load(path, ignore_loops=True)
        self.model = within(self.mechanism)
        pin.seed(1)
        self.meshes = MeshContact(self.mechanism, [pin.randomConfiguration(self.model) for _ in range(500)])
        links = self.mechanism.structure.derived(link_pairs)
        self.reasons: dict[frozenset[str], set[PairReason]] = {}
        for (i, k), reason in links.reasons.items():
            self.reasons.setdefault(frozenset((links.bodies[i].name, links.bodies[k].name)), set()).add(reason)
        self.constant = {names for names, reasons in self.reasons.items() if PairReason.ALWAYS in reasons}
        self.clearance = Clearance(self.mechanism, links.bodies, (), links.of(PairReason.CHECKED))
        self.still, self.told = np.zeros(self.model.nv), set[str]()

    def names(self, pair: tuple[int, int]) -> frozenset[str]:
        """The links of two shapes."""
        return frozenset(self.meshes.names[i] for i in pair)

    def is_clear(self, q: np.ndarray, margin: float) -> bool:
        """The checker's answer, by the test that plans and drags use."""
        return self.clearance.uncertain(q, self.still, margin, self.clearance.every_pair) is not None

    def is_missed(self, q: np.ndarray, margin: float = 0.0) -> bool:
        """Whether other meshes than those in constant contact are nearer than a margin; their names are kept."""
        missed = {self.names(pair) for pair in self.meshes.touching(q, margin)} - self.constant
        for names in missed:
            why = "/".join(sorted(reason.name.lower() for reason in self.reasons.get(names, set())))
            self.told.add(f"{'-'.join(sorted(names))} ({why})")
        return bool(missed)

    def sample(self, count: int, seconds: float, margin: float) -> str:
        """The columns of random configurations."""
        touching = missed = free = refused = done = 0
        end, spent = time.process_time() + seconds, 0.0
        pin.seed(2)
        while done < count and time.process_time() < end:
            q, since = pin.randomConfiguration(self.model), time.process_time()
            is_clear, done = self.is_clear(q, margin), done + 1
            spent += time.process_time() - since
            if self.meshes.touches(q):
                touching += 1
                missed += self.is_clear(q, TOUCH) and self.is_missed(q)
            elif is_clear:
                free += 1
                missed += self.meshes.touches(q, margin - TOUCH) and self.is_missed(q, margin - TOUCH)
            elif not self.meshes.touches(q, margin):
                free += 1
                refused += 1
        share = f"{100 * refused / free:.2f} %" if free else "-"
        bound = f"<{3 / touching:.1g}" if touching else "-"
        return (
            f"{done:6} {touching:8} {missed:6} {bound:>7} {free:6} {refused:7} {share:>7}"
            f" {1e6 * spent / max(done, 1):7.0f}"
        )

    def seek(self, seconds: float) -> str:
        """Contacts found, those told clear, and the pairs of shapes that came to contact, of those judged."""
        sought = told_clear = 0
        contacts, end = set[tuple[int, int]](), time.process_time() + seconds
        rng, pairs = np.random.default_rng(3), self.meshes.pairs
        pin.seed(3)
        order: list[int] = []
        while pairs and time.process_time() < end:
            order = order or rng.permutation(len(pairs)).tolist()
            pair, q = pairs[order.pop()], pin.randomConfiguration(self.model)
            before = q
            for _ in range(NEWTON):
                distance, rates = self.meshes.approach(q, pair)
                if distance <= 0.0 or not rates @ rates > 1e-12:
                    break
                step = -rates * (distance + 1e-3) / (rates @ rates)
                step *= min(1.0, 0.5 / max(np.abs(step).max(), 1e-12))
                before, q = q, self.confined(pin.integrate(self.model, q, step))
            if distance > 0.0:
                continue
            contacts.add(pair)
            touch = [q]
            for _ in range(HALVINGS if before is not q else 0):
                half = pin.interpolate(self.model, before, q, 0.5)
                if self.meshes.touching(half, pairs=[pair]):
                    q = half
                    touch.append(half)
                else:
                    before = half
            for at_contact in touch:
                sought += 1
                told_clear += self.is_clear(at_contact, TOUCH) and self.is_missed(at_contact)
        return f"{sought:7} {told_clear:10} {len(contacts):5}/{len(pairs):<5}"

    def confined(self, q: np.ndarray) -> np.ndarray:
        """A configuration within the limits; floating bases stay as they are."""
        at = np.array([j.idx_q for j in self.model.joints[1:] if j.nq == 1 and j.nv == 1], dtype=int)
        q = q.copy()
        q[at] = np.clip(q[at], self.model.lowerPositionLimit[at], self.model.upperPositionLimit[at])
        return q


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="parts of the files' names; all by default")
    parser.add_argument("--after", default="", help="only robots behind this one in the listing")
    parser.add_argument("--count", type=int, default=10000)
    parser.add_argument("--seconds", type=float, default=20.0, help="of CPU time for random configurations of a robot")
    parser.add_argument("--seek", type=float, default=5.0, help="the same for contacts that are sought")
    parser.add_argument("--margin", type=float, default=1e-3, help="m")
    options = parser.parse_args()
    print(
        f"{'robot':<32}{'count':>6} {'touching':>8} {'missed':>6} {'':7} {'free':>6} {'refused':>7} {'':7} {'us':>7}"
        f" {'sought':>7} {'told clear':>10} {'of pairs':>11} constant"
    )
    paths = sorted(EXAMPLES.rglob("*.urdf"))
    behind = max((i + 1 for i, path in enumerate(paths) if path.stem == options.after), default=0)
    for path in paths[behind:]:
        if options.names and not any(name in path.name for name in options.names):
            continue
        try:
            judge = Judge(path)
            if not judge.meshes.drawn or not judge.model.nv:
                text = "no shapes, or no joints"
            else:
                text = f"{judge.sample(options.count, options.seconds, options.margin)} {judge.seek(options.seek)} "
                text += f"{len(judge.constant)}"
                text += f"  told clear: {', '.join(sorted(judge.told))}" if judge.told else ""
        except cinegen.CinegenError as error:
            text = f"can't be loaded: {str(error)[-80:]}"
        print(f"{path.stem:<32}{text}", flush=True)


if __name__ == "__main__":
    main()
