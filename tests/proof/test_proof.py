"""Proofs of workspaces: regions known by plane geometry, poses of the solver, singular poses, mutated certificates."""

import copy
import itertools
import json
import math
import pickle
import random
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from flint import arb, arb_mat, ctx
from matplotlib.colors import to_rgba
from scipy.spatial.transform import Rotation
from small_robots import rssr
from variants import slow

import cinegen
import cinegen.proof.checker
import cinegen.proof.distributed_checks
from cinegen.collision.body import geometry_model
from cinegen.collision.self_collision import PairReason, link_pairs
from cinegen.design import Parameters, WithinTolerances
from cinegen.plotting.proof import COLOURS, draw_proof
from cinegen.proof import CertificateError, ProofError, check, checker, load_proof, prove, singular
from cinegen.proof.checker.equations import Robot, Value
from cinegen.proof.checker.singular import smallest
from cinegen.proof.checker.tube import Tube
from cinegen.proof.equations import Equations
from cinegen.proof.prover import Prover
from cinegen.proof.result import read_proof
from cinegen.proof.singular import SingularValues
from cinegen.proof.tubes import Tubes
from cinegen.singularities import singularity
from cinegen.singularities.slice import POSE, Coordinates, SliceError

ROBOTS = Path(__file__).parents[2] / "robots"
RECTANGLE = {"x": (-0.08, 0.08), "y": (0.40, 0.55)}
INSIDE = {
    "delta4": ({"x": (-0.1, 0.1), "y": (-0.1, 0.1), "z": (-2.56, -2.44)}, True),
    "gough": ({"x": (0.02, 0.12), "y": (-0.1, 0.0), "z": (0.85, 0.95), "rz": (0.16, 0.26)}, False),
    "cusp_3rpr": ({"rz": (-0.02, 0.02)}, False),
    "delta4_linear": ({"x": (-0.02, 0.02), "y": (-0.02, 0.02)}, True),
    "sr400": ({"rz": (-0.02, 0.02)}, True),
}
"""Regions about home or below it, and whether limits are asked for."""


@pytest.fixture(scope="module")
def rectangle(robot):
    return prove(robot("five_bar"), RECTANGLE, limits=True)


def within_limits(mechanism, q):
    limits = mechanism.limits
    return bool((q >= limits.lower).all() and (q <= limits.upper).all())


def poses_in(over, count, rng):
    """Random poses of a region, by coordinate."""
    low, high = np.transpose([*over.values()])
    return [dict(zip(over, values, strict=True)) for values in rng.uniform(low, high, (count, len(over)))]


def test_beyond_the_reach_nothing_is_proved_and_most_is_refuted(robot):
    proof = prove(robot("five_bar"), {"x": (-0.02, 0.02), "y": (0.58, 0.66)}, boxes=300)
    assert not proof
    assert proof.proved < 0.66  # the reach ends at hypot(x -+ 150, y) = 650 mm: y = 632 on the axis
    assert proof.refuted > 0.3
    reasons = "no unique configuration is proved", "no configuration is found", "it is not connected to the start"
    assert set(proof.reasons) <= {*reasons}
    assert not proof.witnesses[0]["configuration"]
    rng = np.random.default_rng(2)
    for box, status in proof.cells():
        for x, y in rng.uniform(*box.T, (5, 2)):
            reached = all(0.15 < math.hypot(x - base, y) < 0.65 for base in (-0.15, 0.15))
            assert status == "undecided" or reached is (status == "proved")


def test_a_region_whose_middle_is_out_of_reach_is_proved_from_home(robot):
    over = {"x": (-0.02, 0.02), "y": (0.4, 0.9)}  # of which y < 632 mm is reached
    proof = prove(robot("five_bar"), over, limits=True, boxes=300)
    assert proof.proved == pytest.approx(0.46, abs=0.02)
    assert proof.refuted == pytest.approx(0.53, abs=0.02)
    assert prove(robot("five_bar"), {"x": (0.8, 0.9), "y": (0.3, 0.5)}).refuted == 1.0
    assert prove(robot("five_bar"), over, grow=True).reasons == {"the branch ends before the middle of the region": 1}


def test_legs_of_limited_length_reach_nowhere_far_away(robot):
    proof = prove(robot("gough"), {"x": (0.6, 0.7), "y": (-0.05, 0.05), "z": (0.85, 0.95)}, limits=True)
    assert proof.refuted == 1.0  # by a limit, with a configuration
    certificate = {**proof.certificate, "tree": [{"claim": "unreachable", "reason": ""}]}
    assert check(certificate)["refuted"] == 1.0
    with pytest.raises(CertificateError, match="not out of reach"):
        check({**certificate, "bounds": {**certificate["bounds"], "limits": False}})


def test_a_claim_that_the_checker_does_not_confirm_is_undecided(robot, monkeypatch):
    tree = Prover.tree

    def bold(prover):
        nodes = tree(prover)
        first = next(node for node in nodes if isinstance(node, dict))
        first["y"] = [1e-3 * y for y in first["y"]]
        return nodes

    monkeypatch.setattr(Prover, "tree", bold)
    proof = prove(robot("five_bar"), RECTANGLE)
    assert 0.5 < proof.proved < 1.0
    assert proof.reasons["the checker does not confirm it"] == 1


def test_a_limit_refutes_with_a_witness(robot):
    mechanism = robot("gough")
    proof = prove(mechanism, {"z": (0.95, 1.4)}, limits=True, boxes=40)
    assert proof.refuted > 0.1
    for witness in proof.witnesses:
        q = Coordinates(mechanism, ["z"]).from_home(witness["pose"])
        assert q is not None
        k = mechanism.q_index(witness["limit"])
        assert not mechanism.limits.lower[k] <= q[k] <= mechanism.limits.upper[k]
        assert witness["configuration"][witness["limit"]] == pytest.approx(q[k], abs=0.05)


@pytest.mark.parametrize("name", INSIDE)
def test_random_poses_of_proved_regions(robot, name):
    mechanism, (over, limits) = robot(name), INSIDE[name]
    home = Coordinates(mechanism, list(over)).home
    if name != "delta4" and name != "gough":
        over = {key: (low + home[key], high + home[key]) for key, (low, high) in over.items()}
    proof = prove(mechanism, over, limits=limits, boxes=200)
    assert proof, proof
    coordinates, rng, document = Coordinates(mechanism, list(over)), np.random.default_rng(7), proof.certificate
    equations = Equations(document)
    names = [document["variables"][k]["name"] for k in document["unknown"]]

    def unknown(q):
        return np.array([q[mechanism.q_index(name)] for name in names]) / equations.units

    for pose in poses_in(over, 20, rng):
        q = coordinates.from_home(pose, steps=4)
        values = np.array(list(pose.values()))
        assert q is not None
        residual = equations.at(unknown(q)[None], values[None]).residual[0, 0, document["rows"]]
        assert np.abs(residual).max() < 1e-9  # the equations of the certificate are those of the solver
        assert not limits or within_limits(mechanism, q)


def test_fichters_pose_is_never_proved(robot):
    at = {"x": 0.0, "y": 0.0, "z": 0.02, "rx": 0.0, "ry": 0.0}
    proof = prove(robot("tssm"), {"rz": tuple(np.radians([70.0, 100.0]))}, at, boxes=60)
    assert not proof
    assert {witness["determinant"] for witness in proof.witnesses} == {1, -1}
    poses = sorted(math.degrees(witness["pose"]["rz"]) for witness in proof.witnesses)
    assert poses[0] < 90.0 < poses[1]
    assert "a singularity of type 2 is not excluded" in proof.reasons


def legs_of(gough, poses):
    """Lengths (n, 6) of a Gough platform's legs, and determinants (n,) of their lines, by its geometry at home."""
    data = gough.model.createData()
    pin.forwardKinematics(gough.model, data, gough.q_home)
    at = {name: data.oMi[gough.model.getJointId(name)] for name in gough.joints}
    bases = np.array([at[f"joint{k}"].translation for k in (1, 7, 10, 13, 16, 19)])
    home = gough.placement(gough.q_home, gough.end)
    tops = np.array([home.actInv(at[f"joint{k}"].translation) for k in (3, 9, 12, 15, 18, 21)])
    turned = Rotation.from_euler("ZYX", poses[:, :2:-1]).as_matrix() @ tops.T
    turned = turned.swapaxes(1, 2)
    vectors = poses[:, None, :3] + turned - bases
    lengths = np.linalg.norm(vectors, axis=2)
    lines = np.concatenate([vectors, np.cross(turned, vectors)], axis=2) / lengths[..., None]
    return lengths, np.linalg.det(lines)


def test_a_singularity_in_six_coordinates_has_a_witness_soon(robot):
    turn = math.radians(5.0)
    over = dict(zip(POSE, [(-0.05, 0.05)] * 2 + [(0.85, 0.95)] + [(-turn, turn)] * 2, strict=False))
    over["rz"] = tuple(np.radians([60.0, 100.0]))
    proof = prove(robot("gough"), over, boxes=150)
    assert [witness["determinant"] for witness in proof.witnesses] == [1, -1]
    poses = np.array([[witness["pose"][name] for name in POSE] for witness in proof.witnesses])
    assert np.prod(legs_of(robot("gough"), poses)[1]) < 0.0
    ends = np.array(list(over.values()))
    some = np.random.default_rng(0).uniform(*ends.T, (4000, 6))
    determinants = legs_of(robot("gough"), np.array([ends.mean(axis=1), *some]))[1]
    assert 0.4 < proof.proved < np.mean(determinants * determinants[0] > 0.0)  # where it has the sign of the start


def test_mechanisms_whose_pose_is_not_enough_are_undecided(robot):
    for name in ("arm7", "planar_hybrid"):
        home = Coordinates(robot(name), ["x"]).home["x"]
        proof = prove(robot(name), {"x": (home, home + 0.01)})
        assert proof.undecided == 1.0
        assert proof.reasons == {"the pose does not determine the configuration": 1}


# --- regions that grow, tolerances --------------------------------------------------------------------------------


def five_bar_reach(half, centre=(0.0, 0.475), width=0.65):
    """How much farther the upper corners of a box are from a base of the five-bar than both its bars reach."""
    return math.hypot(half[0] + 0.15, centre[1] + half[1]) - width


def test_the_largest_box_of_a_five_bar_is_that_of_plane_geometry(robot):
    proof = prove(robot("five_bar"), RECTANGLE, grow=True, boxes=1000)
    assert proof
    half = np.array([0.5 * (high - low) for low, high in proof.region.values()])
    np.testing.assert_allclose(half / half[0], np.array([0.08, 0.075]) / 0.08)
    assert five_bar_reach(half) < 0.0 < five_bar_reach(1.03 * half)


def test_a_round_region_leaves_out_corners_that_are_out_of_reach(robot):
    mechanism, over = robot("five_bar"), {"x": (-0.15, 0.15), "y": (0.335, 0.615)}
    box, ball = (prove(mechanism, over, shape=shape, boxes=300) for shape in ("box", "ball"))
    assert ball, ball
    assert not box
    outside = [node for node in ball.certificate["tree"] if isinstance(node, dict) and node["claim"] == "outside"]
    assert outside
    other = copy.deepcopy(ball.certificate)
    leaves = [node for node in other["tree"] if isinstance(node, dict) and node["claim"] != "outside"]
    leaves[len(leaves) // 2]["claim"] = "outside"
    with pytest.raises(CertificateError, match="called outside is not"):
        check(other)
    with pytest.raises(ProofError, match="no region 'cylinder' over 1 coordinates"):
        prove(robot("five_bar"), {"x": (0.0, 0.1)}, shape="cylinder")


@pytest.mark.parametrize(
    ("name", "over", "tolerances"),
    [
        ("five_bar", RECTANGLE, {"link*.d": "0.05mm"}),
        ("delta4", INSIDE["delta4"][0], {"link*.d": "0.05mm"}),
        pytest.param("delta4", INSIDE["delta4"][0], {"*": "0.05mm"}, marks=pytest.mark.slow),
        ("gough", {"x": (0.04, 0.08), "y": (-0.06, -0.02)}, {"link1.*": "0.05mm", "link*.alpha": "0.02deg"}),
    ],
)
def test_all_robots_within_tolerances(name, over, tolerances):
    parameters = Parameters(name)
    proof = prove(parameters.mechanism, over, limits=True, tolerances=WithinTolerances(parameters, tolerances))
    assert proof, proof
    errors, rng = proof.certificate["bounds"]["tolerances"], np.random.default_rng(2)
    for _ in range(4):
        values = {key: parameters.values[parameters.index(key)] + rng.uniform(-e, e) for key, e in errors.items()}
        mechanism = parameters.mechanism_with(parameters.with_changed(values))
        coordinates = Coordinates(mechanism, list(over))
        pose = {key: rng.uniform(*ends) for key, ends in over.items()}
        q = coordinates.from_home(pose, steps=10)
        assert q is not None
        assert within_limits(mechanism, q)
        point = {key: (value, value + 1e-6) for key, value in pose.items()}
        other = prove(mechanism, point, limits=True, boxes=1).certificate
        ours, theirs = (tolerated(document) for document in (proof.certificate, other))
        for (numbers, radii), (values, _) in zip(ours, theirs, strict=True):
            assert (np.abs(numbers - values) <= radii + 1e-12).all()


def test_singular_values_of_all_robots_within_tolerances(robot):
    parameters, rng = Parameters("five_bar"), np.random.default_rng(4)
    over, within = {"x": (-0.02, 0.02), "y": (0.45, 0.47)}, WithinTolerances(parameters, {"link*.d": "0.1mm"})
    lengths = [error.name for error in within.errors]

    def sigma():
        values = {name: parameters.values[parameters.index(name)] + rng.choice([-1e-4, 1e-4]) for name in lengths}
        other = parameters.mechanism_with(parameters.with_changed(values))
        pose = {key: rng.uniform(*ends) for key, ends in over.items()}
        return min(singularity(other, Coordinates(other, list(over)).from_home(pose, steps=10)).sigma)

    least = min(sigma() for _ in range(30))
    assert prove(parameters.mechanism, over, sigma=0.9 * least, tolerances=within, boxes=60)
    assert not prove(parameters.mechanism, over, sigma=1.02 * least, tolerances=within, boxes=60)


def tolerated(document):
    """Placements in the order of the chains, with their radii."""
    used = [c[side] + [[c[f"{side}_end"], -1]] for c in document["closures"] for side in ("first", "second")]
    none = [[0.0] * 12] * len(document["placements"])
    radii = document.get("radii", none)
    return [(np.array(document["placements"][i]), np.array(radii[i])) for chain in used for i, _ in chain]


def test_tolerances_that_no_joint_compensates_are_named(robot):
    parameters = Parameters("five_bar")
    with pytest.raises(ProofError, match=r"no joint can compensate an error of 0\.05 mm of link1\.epsilon"):
        prove(parameters.mechanism, RECTANGLE, tolerances=WithinTolerances(parameters, {"*": "0.05mm"}))
    with pytest.raises(ProofError, match="the tolerances are of linkage: give this robot's"):
        prove(robot("delta4"), INSIDE["delta4"][0], tolerances=WithinTolerances(parameters, {"link*.d": 1e-4}))


def test_what_can_not_be_asked(robot):
    with pytest.raises(ProofError, match="a range is empty"):
        prove(robot("five_bar"), {"x": (0.1, 0.1)})
    with pytest.raises(ProofError, match="over coordinates of a pose"):
        prove(robot("five_bar"), {})
    with pytest.raises(SliceError, match="no coordinate 'elbow'"):
        prove(robot("five_bar"), {"elbow": (0.0, 0.1)})


def test_certificates_are_read_again(rectangle, tmp_path):
    (tmp_path / "a.json").write_text(json.dumps(rectangle.certificate))
    assert load_proof(tmp_path / "a.json").as_dict() == rectangle.as_dict()
    (tmp_path / "b.json").write_text("[]")
    with pytest.raises(ProofError, match="is no certificate"):
        load_proof(tmp_path / "b.json")
    with pytest.raises(ProofError, match="can't be read"):
        load_proof(tmp_path / "c.json")
    for damage in ({"length": "long"}, {"tree": None}, {"tree": [{"x": []}], "bounds": []}):
        (tmp_path / "d.json").write_text(json.dumps({**rectangle.certificate, **damage}))
        with pytest.raises(ProofError, match=r"d\.json: the certificate is rejected: it is damaged"):
            load_proof(tmp_path / "d.json")


def test_boxes_may_be_examined_by_other_processes_in_any_order(rectangle):
    def others(function, tasks, data):
        for task in reversed(list(tasks)):
            sent = pickle.loads(pickle.dumps((function, data, task)))
            yield task, pickle.loads(pickle.dumps(sent[0](*sent[1:])))

    assert check(rectangle.certificate, spread=others) == check(rectangle.certificate)
    seen = []
    again = read_proof(rectangle.certificate, workers=2, report=lambda *step: seen.append(step))
    assert again.as_dict() == rectangle.as_dict()
    assert seen[-1] == ("checking", rectangle.boxes, rectangle.boxes)


def test_an_interrupted_proof_goes_on_where_it_was(robot, tmp_path, monkeypatch):
    monkeypatch.setattr(cinegen.proof.distributed_checks, "_WORTH", (1, 1))
    monkeypatch.setattr(cinegen.proof.checker, "_TASK", 1)
    examine, numbers = cinegen.proof.checker.examine, []
    monkeypatch.setattr(
        cinegen.proof.checker, "examine", lambda data, boxes: numbers.append(boxes[0].number) or examine(data, boxes)
    )

    def interrupt(stage, done, total):
        if (stage, done) == ("checking", 6):
            raise KeyboardInterrupt

    part, whole = tmp_path / "proof.json.part", prove(robot("five_bar"), RECTANGLE)
    with pytest.raises(KeyboardInterrupt):
        prove(robot("five_bar"), RECTANGLE, report=interrupt, unfinished=part)
    part.write_text(part.read_text() + '\n[11, "", "prov')  # and a line that was not written to its end
    numbers.clear()
    assert prove(robot("five_bar"), RECTANGLE, unfinished=part).certificate == whole.certificate
    assert len(numbers) == whole.boxes - 5
    assert not part.exists()
    with pytest.raises(KeyboardInterrupt):
        prove(robot("five_bar"), RECTANGLE, limits=True, report=interrupt, unfinished=part)
    numbers.clear()
    prove(robot("five_bar"), RECTANGLE, unfinished=part)  # something else is asked
    assert len(numbers) == whole.boxes
    part.write_text("")
    assert prove(robot("five_bar"), RECTANGLE, unfinished=part)
    part.write_text("a file of somebody")
    with pytest.raises(ProofError, match="move it away, or give another output"):
        prove(robot("five_bar"), RECTANGLE, unfinished=part)
    assert part.read_text() == "a file of somebody"


def test_a_picture_shows_each_box(robot):
    proof = prove(robot("gough"), {"x": (-0.5, 0.6), "z": (0.6, 1.5)}, limits=True, boxes=60)
    assert proof.refuted > 0.05
    cells = list(proof.cells())
    for name in proof.statuses:
        size = sum(np.prod(box[:, 1] - box[:, 0]) for box, status in cells if status == name)
        assert size / (1.1 * 0.9) == pytest.approx(getattr(proof, name))
    axes = draw_proof(proof, name="gough").subfigs[0].axes[0]
    assert len(axes.patches) == len(cells)
    assert {patch.get_facecolor() for patch in axes.patches} == {to_rgba(COLOURS[status]) for _, status in cells}
    for over in ({"rz": (-0.1, 0.1)}, {"x": (0.0, 0.1), "rz": (0.0, 0.1), "z": (0.85, 0.95)}):
        assert draw_proof(prove(robot("gough"), over)).subfigs[0].axes[0].patches


# --- derivatives --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "over"),
    [("five_bar", "xy"), ("delta4", "xyz"), ("gough", ("x", "rx", "rz")), ("cusp_3rpr", ("rz",)), ("sr400", ("rz",)),
     ("belt_five_bar", "xy")],
)  # fmt: skip
def test_derivatives_over_a_box_contain_those_at_its_points(robot, name, over):
    """By the kernel, and by the checker, which shares no code with it."""
    home = Coordinates(robot(name), list(over)).home
    box = {key: (home[key] - 0.01, home[key] + 0.01) for key in over}
    document = prove(robot(name), box, sigma=0.0 if name == "gough" else None, boxes=1).certificate
    equations, rng = Equations(document), np.random.default_rng(5)
    x, p = np.array(document["start"]["x"]) / equations.units, np.array(document["start"]["pose"])
    n, y = len(p), 0.002 * rng.uniform(size=len(x))
    pairs = list(itertools.combinations_with_replacement(range(n), 2))
    along = rng.normal(size=(len(x) + n, n + len(pairs))) * ([0.03] * n + [0.002] * len(pairs))
    along[len(x) :, n:] = 0.0
    at, change = equations.at(x[None], p[None]), equations.change(x[None], p[None], along[None], y[None])
    around = change.bent[0] + change.apart[0] + 1e-12
    for _ in range(30):
        eps, d = rng.uniform(-1.0, 1.0, n), y * rng.uniform(-1.0, 1.0, len(y))
        eta = np.array([*eps, *(eps[j] * eps[k] for j, k in pairs)])
        moved = along @ eta
        other = equations.at((x + moved[: len(x)] + d)[None], (p + moved[len(x) :])[None]).jacobian[0, 0]
        assert (np.abs(other - at.jacobian[0, 0] - np.tensordot(eta, change.whole[0], 1)) <= around).all()
    with ctx.workprec(64):
        checker, values = Robot(document), [*zip(x, along, y, strict=False)]
        wide = checker.values(
            [Value(arb(float(a)), [arb(float(b)) for b in row], arb(float(r))) for a, row, r in values],
            [
                Value(arb(float(a)), [arb(float(b)) for b in row], arb(0))
                for a, row in zip(p, along[len(x) :], strict=True)
            ],
        )
        point = [value._replace(g=[], r=arb(0)) for value in wide]
        at_point = checker.parts(point, 2)
        parts = checker.change(wide, at_point, checker.parts(wide, 2, True))
        numbers = [
            np.array([[float(v.mid()) for v in row] for row in m]) for m in (checker.jacobian(point, at_point), *parts)
        ]
    kernel = (at.jacobian[0, 0], *change.by[0], *change.sharper[0], change.bent[0], change.apart[0])
    for theirs, ours in zip(numbers, kernel, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-5, atol=1e-10)


def test_derivatives_are_those_of_finite_differences(robot):
    document = prove(robot("gough"), INSIDE["gough"][0], boxes=1).certificate
    equations, h = Equations(document), 1e-6
    x, p = np.array(document["start"]["x"]) / equations.units, np.array(document["start"]["pose"])
    for k, step in enumerate(h * np.eye(len(x))):
        ends = (equations.at((x + sign * step)[None], p[None]).residual[0, 0] for sign in (1.0, -1.0))
        slope = (next(ends) - next(ends)) / (2.0 * h)
        np.testing.assert_allclose(slope, equations.at(x[None], p[None]).jacobian[0, 0, :, k], atol=1e-8)


# --- singular values ----------------------------------------------------------------------------------------------

CENTRES = {
    "five_bar": ("x", "y"), "delta4": ("x", "y", "z"), "gough": ("x", "rx", "rz"), "cusp_3rpr": ("rz",),
    "sr400": ("rz",), "belt_five_bar": ("x", "y"), "scara": ("x", "y"),
}  # fmt: skip
"""Coordinates of mechanisms: planar loops, one with a belt, spatial ones, parallelograms, cut joints, couplings."""


def around(mechanism, names, width):
    home = Coordinates(mechanism, list(names)).home
    return {name: (home[name] - width, home[name] + width) for name in names}


@pytest.mark.parametrize("name", CENTRES)
def test_bounds_of_singular_values_contain_those_at_poses(robot, name):
    """In a tiny box they are those of `singularity`, else they contain them; likewise the prover's."""
    mechanism, names = robot(name), CENTRES[name]
    coordinates = Coordinates(mechanism, list(names))
    for width in (1e-9, 0.005):
        proof = prove(mechanism, around(mechanism, names, width), sigma=1e-6, limits=name == "gough", boxes=1)
        assert proof.boxes == 1
        with ctx.workprec(64):
            low, high = zip(*proof.certificate["over"].values(), strict=True)
            tube = Tube(Robot(proof.certificate), low, high, proof.certificate["tree"][0])
            bounds = [[float(x) for x in pair] for pair in smallest(tube)]
        assert proof.statuses == ("proved",)
        for values in np.random.default_rng(2).uniform(low, high, (8, len(names))):
            q = coordinates.from_home(dict(zip(names, values, strict=True)), steps=4)
            assert q is not None
            for (least, most), value in zip(bounds, singularity(mechanism, q).sigma, strict=True):
                assert least < value * (1.0 + 1e-9) < most * (1.0 + 2e-9)
                if width < 1e-6:
                    assert most - least < 0.1 * value  # powers of a matrix bound its norm to some percent


@pytest.mark.parametrize("scales", [(3.0, 1.0, 0.5, 0.1), (2.0, 2.0, 2.0, 1.0), (0.0, 0.0, 0.0, 0.0)])
def test_the_largest_singular_value_of_a_sum_of_matrices_is_below_its_bound(scales):
    random = np.random.default_rng(47)
    at, changes = Rotation.random(rng=random).as_matrix() @ np.eye(3, 4) * scales, 0.1 * random.normal(size=(5, 3, 4))
    near = singular._near(at[None], changes[None])[0]
    by_balls = checker.singular._square(
        [arb_mat(at[:1].tolist()), arb_mat(at[1:].tolist())],
        [[arb_mat(m[:1].tolist()), arb_mat(m[1:].tolist())] for m in changes],
    )
    assert math.sqrt(float(by_balls.upper())) == pytest.approx(near, rel=1e-2)  # by powers
    bound = math.hypot(near, np.linalg.norm(changes, 2, axis=(1, 2)).sum())
    sums = at + np.einsum("ek,kij->eij", random.choice([-1.0, 1.0], (10_000, 5)), changes)
    largest = np.linalg.norm(sums, 2, axis=(1, 2)).max()
    assert largest <= bound
    assert bound < np.linalg.norm(at, 2) + np.linalg.norm(changes, 2, axis=(1, 2)).sum() or scales[0] == scales[1]


def test_singular_values_of_the_equations_are_those_of_maps(robot):
    """K of both types at points, by the kernel alone."""
    belt, shaft = "link 1 link 11 ratio 0.333333333333333333 }", "link 13 link 11 ratio 5 }"
    text = (ROBOTS / "belt_five_bar.raff").read_text().replace(belt, f"{shaft} coupling {{ link 1 link 13 ratio 0.1 }}")
    train = cinegen.load(text.replace("frame 20 {", "link 13 { type 2 pred 0 } frame 20 {", 1))
    for name, mechanism in [*((name, robot(name)) for name in CENTRES), ("train", train)]:
        names = CENTRES.get(name, ("x", "y"))
        proof = prove(mechanism, around(mechanism, names, 1e-7), sigma=1e-6, limits=name == "gough", boxes=1)
        document = proof.certificate
        equations = Equations(document)
        equations.rows = np.array(document["rows"])
        values = SingularValues(equations, document)
        x, p = np.array(document["tree"][0]["x"]) / equations.units, np.array(document["start"]["pose"])
        along = np.zeros((1, len(x) + len(p), len(names) * (len(names) + 3) // 2))
        nothing, none = np.zeros((1, len(x))), np.zeros(1, dtype=int)
        at, change = equations.at(x[None], p[None]), equations.change(x[None], p[None], along, nothing)
        least, most = values.smallest(Tubes(x[None], p[None], along, nothing, none, nothing, at, change, none))
        q = Coordinates(mechanism, list(names)).from_home(dict(zip(names, p, strict=True)), steps=2)
        expected = singularity(mechanism, q).sigma
        np.testing.assert_allclose(least[:, 0], expected[: len(least)], atol=1e-9)
        np.testing.assert_allclose(most[:, 0], expected[: len(least)], atol=1e-9)


def test_a_bound_that_no_pose_violates_by_half_is_proved_and_one_above_the_least_is_not(robot):
    for name, over in (("five_bar", RECTANGLE), ("delta4", NEAR["delta4"])):
        mechanism = robot(name)
        coordinates, ends = Coordinates(mechanism, list(over)), np.array(list(over.values())).T
        poses = [*itertools.product(*ends.T), *np.random.default_rng(3).uniform(*ends, (40, len(over)))]
        closed = [coordinates.from_home(dict(zip(over, p, strict=True)), steps=6) for p in poses]
        least = float(np.min([singularity(mechanism, q).sigma for q in closed]))
        assert prove(mechanism, over, sigma=0.5 * least)
        proof = prove(mechanism, over, sigma=1.02 * least, boxes=150)
        assert not proof
        assert proof.reasons or proof.witnesses


def test_a_singular_value_below_its_bound_refutes_with_a_witness(robot):
    mechanism = robot("five_bar")
    proof = prove(mechanism, RECTANGLE, sigma=0.24, boxes=100)
    assert proof.refuted > 0.1
    coordinates = Coordinates(mechanism, list(RECTANGLE))
    for witness in proof.witnesses:
        q = coordinates.from_home(witness["pose"], steps=6)
        assert witness["sigma"] == "sigma_1"
        assert singularity(mechanism, q).sigma[0] < 0.24


def test_what_has_no_bound_of_singular_values_says_why(robot):
    home = Coordinates(robot("ankle"), ["x"]).home["x"]
    proof = prove(robot("ankle"), {"x": (home, home + 0.01)}, sigma=0.01)
    assert proof.reasons == {"singular values are not bounded where coordinates follow from others: z": 1}
    with pytest.raises(ProofError, match="sigma is -1"):
        prove(robot("five_bar"), RECTANGLE, sigma=-1.0)


# --- distances ----------------------------------------------------------------------------------------------------

NEAR = {
    "five_bar": RECTANGLE,
    "delta4": {"x": (-0.03, 0.03), "y": (-0.03, 0.03), "z": (-2.52, -2.48)},
    "gough": {"x": (0.05, 0.09), "z": (0.88, 0.92), "rz": (0.18, 0.24)},
}


def distances(mechanism, of=None):
    """A function that returns the least distance between the shapes of a description, by Pinocchio, or between those of
    another robot on the same joints."""
    bodies, pairs = (lambda pairs: (pairs.bodies, pairs.of(PairReason.CHECKED)))(link_pairs(of or mechanism))
    geometry = geometry_model(mechanism, [body.as_described for body in bodies], pairs=pairs)
    data, shapes = mechanism.model.createData(), geometry.createData()

    def least(q):
        pin.forwardKinematics(mechanism.model, data, q)
        pin.updateGeometryPlacements(mechanism.model, data, geometry, shapes)
        return shapes.distanceResults[pin.computeDistances(geometry, shapes)].min_distance

    return least


@pytest.mark.parametrize("name", NEAR)
def test_distances_are_above_a_clearance_just_below_the_least_one_at_poses(robot, name):
    mechanism, over, rng = robot(name), NEAR[name], np.random.default_rng(6)
    coordinates, least = Coordinates(mechanism, list(over)), distances(mechanism)

    known = min(least(coordinates.from_home(pose, steps=4)) for pose in poses_in(over, 30, rng))
    assert known > 0.05  # m
    assert prove(mechanism, over, limits=True, clearance=0.9 * known, boxes=50)
    proof = prove(mechanism, over, limits=True, clearance=1.1 * known, boxes=50)
    assert proof.refuted > 0.0
    assert {*proof.reasons} <= {f"{witness['clearance']} may be near" for witness in proof.witnesses}
    for witness in proof.witnesses[:5]:
        assert least(coordinates.from_home(witness["pose"], steps=4)) < 1.1 * known


@pytest.mark.parametrize("name", ["five_bar", "delta4"])
def test_distances_with_tolerances_are_those_of_all_robots(name):
    """Robots at random within the tolerances, whose links keep their shapes, at random poses."""
    parameters, over, rng = Parameters(name), NEAR[name], np.random.default_rng(8)
    within = WithinTolerances(parameters, {"link*.d": 1e-4})
    names, known = [error.name for error in within.errors], math.inf
    for values in 1e-4 * rng.choice([-1.0, 1.0], (6, len(names))):
        changed = {each: parameters.all[parameters.find(each)].value + v for each, v in zip(names, values, strict=True)}
        other = parameters.mechanism_with(parameters.with_changed(changed))
        coordinates, least = Coordinates(other, list(over)), distances(other, parameters.mechanism)
        known = min(known, *(least(coordinates.from_home(pose, steps=4)) for pose in poses_in(over, 10, rng)))
    assert prove(parameters.mechanism, over, clearance=0.9 * known, tolerances=within, boxes=50)
    proof = prove(parameters.mechanism, over, clearance=1.1 * known, tolerances=within, boxes=50)
    assert not proof
    assert proof.refuted > 0.0
    exact = distances(parameters.mechanism)
    for witness in proof.witnesses[:5]:
        q = Coordinates(parameters.mechanism, list(over)).from_home(witness["pose"], steps=4)
        assert exact(q) < 1.1 * known


def test_what_no_clearance_is_proved_of(robot):
    with pytest.raises(ProofError, match=r"the clearance is -0\.1 m"):
        prove(robot("five_bar"), RECTANGLE, clearance=-0.1)
    with pytest.raises(ProofError, match="no two links may collide: leave out the clearance"):
        prove(robot("differential_wrist"), {"rx": (0.0, 0.1)}, clearance=0.0)
    ball = cinegen.load(rssr())
    for mechanism, joint in ((ball, "joint2"), (ball.successive, "joint2_X")):
        with pytest.raises(ProofError, match=rf"rods may rotate about themselves \({joint}\)"):
            prove(mechanism, {"x": (0.0, 0.1)}, clearance=0.0)


# --- mutations ----------------------------------------------------------------------------------------------------


def mutated(certificate, rng):
    """A certificate in which one number or claim of what is proved is another one."""
    mutant = copy.deepcopy(certificate)
    leaves = [node for node in mutant["tree"] if isinstance(node, dict)]
    leaf, factor = rng.choice(leaves), rng.choice([0.0, 0.5, 0.9, 1.1, 2.0, -1.0, 1e9, math.nan])
    kind = rng.randrange(10 if mutant["bounds"]["sigma"] or mutant["bounds"]["clearance"] else 8)
    if kind == 0:
        k = rng.randrange(len(leaf["x"]))
        leaf["x"][k] += rng.choice([1e-9, 1e-3, 0.1, 2.0 * math.pi, -2.0 * math.pi, math.nan])
    elif kind == 1:
        k = rng.randrange(len(leaf["y"]))
        leaf["y"][k] *= factor
    elif kind == 2:
        leaf["claim"] = rng.choice(["proved", "limit", "open", "regular", "unreachable"])
    elif kind == 3:
        k = rng.randrange(len(mutant["tree"]))
        mutant["tree"].insert(k, rng.choice([0, 1, 2, mutant["tree"][k]]))
    elif kind == 4:
        del mutant["tree"][rng.randrange(len(mutant["tree"]))]
    elif kind == 5:
        ends = rng.choice(list(mutant["over"].values()))
        ends[rng.randrange(2)] += rng.choice([0.01, 0.05, 0.3, -0.01, -0.05, -0.3])
    elif kind == 6:
        first, other = rng.sample(leaves, 2)
        first["x"], other["x"] = other["x"], first["x"]
    elif kind == 8:
        bound = "clearance" if mutant["bounds"]["sigma"] is None else "sigma"
        mutant["bounds"][bound] *= rng.choice([0.0, 0.5, 1.1, 1.5, 2.0, 1e9])
    elif kind == 9 and mutant["bounds"]["sigma"]:
        leaf["claim"] = "sigma"
    elif kind == 9:
        rng.choice(leaf["planes"])[rng.randrange(3)] += rng.choice([3, -2000, 30_000, 10**20])
    else:
        variable = rng.choice([v for v in mutant["variables"] if v["limits"][0] is not None])
        variable["limits"][rng.randrange(2)] *= factor
    return mutant


def assert_true(certificate, result, mechanism, rng):
    """What a result says holds at random poses, by Newton's method in doubles."""
    equations = Equations(certificate)
    equations.rows = np.array(certificate["rows"])
    assert all(witness["configuration"] for witness in result["witnesses"])  # all of it is within reach
    if result["proved"] < 1.0:
        return
    coordinates, clearance = Coordinates(mechanism, list(RECTANGLE)), certificate["bounds"]["clearance"]
    least = None if clearance is None else distances(mechanism)
    for pose in poses_in(dict(zip(RECTANGLE, certificate["over"].values(), strict=True)), 30, rng):
        q = coordinates.from_home(pose, steps=10)
        assert q is not None
        by_name = {variable["name"]: variable["limits"] for variable in certificate["variables"]}
        for name in mechanism.joints:
            low_end, high_end = by_name[name]
            assert not certificate["bounds"]["limits"] or low_end <= q[mechanism.q_index(name)] <= high_end
        sigma = certificate["bounds"]["sigma"]
        assert sigma is None or min(singularity(mechanism, q).sigma) > sigma
        assert clearance is None or least(q) > clearance


def mutate(certificate, mechanism, count):
    rng, accepted = random.Random(11), 0
    for _ in range(count):
        other = mutated(certificate, rng)
        try:
            result = check(other)
        except CertificateError:
            continue
        accepted += 1
        assert_true(other, result, mechanism, np.random.default_rng(rng.randrange(2**32)))
    return accepted


@pytest.mark.parametrize(("bounds", "count", "fewest", "most"), [
    ({"limits": True}, 50, 2, 40), ({"limits": True, "sigma": 0.1}, 30, 2, 25), ({"clearance": 0.18}, 20, 2, 17),
    *slow(({"limits": True}, 8_000, 0, 8_000), ({"limits": True, "sigma": 0.1}, 1_000, 0, 1_000),
          ({"clearance": 0.18}, 1_000, 0, 1_000)),
])  # fmt: skip
def test_mutated_certificates_are_rejected_unless_they_are_true(robot, bounds, count, fewest, most):
    proof = prove(robot("five_bar"), {"x": (-0.08, 0.08), "y": (0.45, 0.55)}, **bounds)
    assert proof
    assert fewest < mutate(proof.certificate, robot("five_bar"), count) < most


@pytest.mark.slow
@pytest.mark.parametrize("file", sorted(path.stem for path in ROBOTS.glob("*.raff")))
def test_every_robot_is_answered(robot, file):
    """Proved, refuted or undecided with reasons."""
    mechanism = robot(file)
    for name in POSE:
        try:
            home = Coordinates(mechanism, [name]).home[name]
        except SliceError:
            continue
        proof = prove(mechanism, {name: (home - 0.01, home + 0.01)}, limits=True, boxes=60)
        assert proof.proved + proof.refuted + proof.undecided == pytest.approx(1.0)
        assert proof or proof.reasons or proof.witnesses
