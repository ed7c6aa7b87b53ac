"""Home: closed within all limits wherever such a configuration exists, near to what the file says."""

import numpy as np
import pytest

import cinegen
from raff2urdf.loops.home import close_within


def hinge(name: str, low: float, high: float) -> str:
    return f'<joint name="{name}" type="hinge" axis="0 1 0" range="{low} {high}"/>'


def four_bar(low: float, high: float, start: float = 60.0) -> str:
    """A crank of 0.1 m, a coupler of 0.3 m and a rocker of 0.25 m on a ground of 0.3 m; the rocker has limits."""
    return f"""RAFF bars
    robot r {{
      link 1 {{ parameters {{ theta {start} }} type 2 pred 0 }}
      link 2 {{ parameters {{ d 100 theta -40 }} type 2 pred 1 }}
      frame 3 {{ parameters {{ d 300 }} pred 2 }}
      link 4 {{ parameters {{ d 300 theta 100 }} type 2 pred 0 limits {{ {low} {high} }} }}
      frame 5 {{ parameters {{ d 250 }} pred 4 }}
      constraint {{ frame 3 frame 5 type 2 }}
    }}"""


def test_another_branch_is_taken_where_the_one_as_written_is_beyond_a_limit():
    free = cinegen.load(four_bar(-179.0, 179.0))
    near = np.degrees(free.q_home[free.q_index("joint4")])
    assert near > 0.0
    below = cinegen.load(four_bar(-170.0, -10.0))
    assert below.closure(below.q_home) <= 1e-12
    assert -170.0 <= np.degrees(below.q_home[below.q_index("joint4")]) <= -10.0
    (note,) = [note for note in below.source.notes if "home was moved" in note]
    assert f"joint4 ({near:.4g} deg, limit -10)" in note
    solver = cinegen.Solver(below, dt=0.01)
    task = solver.add_task("frame5", rotation=0)
    task.target.translation += [0.01, 0.0, 0.0]
    for _ in range(50):
        solver.step()
    assert np.abs(solver.q - below.q_home).max() > 1e-2


def test_what_cannot_be_met_is_named_joint_by_joint():
    with pytest.warns(cinegen.CinegenWarning, match=r"no configuration was found .* joint4 \([\d.]+ deg, limit 3\)"):
        mechanism = cinegen.load(four_bar(-3.0, 3.0))
    assert mechanism.closure(mechanism.q_home) <= 1e-12


@pytest.mark.parametrize("name", ["delta4", "gough", "belt_five_bar"])
def test_any_box_of_limits_around_a_closed_configuration_holds_home(robot, name):
    """Limits are drawn around random closed configurations, home is written outside them."""
    mechanism = robot(name)
    system, rng = mechanism.structure.system, np.random.default_rng(5)
    at, columns = mechanism.structure.scalar_joints
    for inside in mechanism.random_closed(6, seed=2):
        margin = rng.uniform(0.0, 0.4, (2, len(inside))) * 1.0
        lower, upper = inside - margin[0], inside + margin[1]
        q = close_within(
            system,
            mechanism.q_home,
            mechanism.q_home,
            lower,
            upper,
            dict(zip(at.tolist(), columns.tolist(), strict=True)),
        )
        assert np.all((q[at] >= lower[at]) & (q[at] <= upper[at]))
        assert mechanism.closure(q) <= 1e-12


def test_joints_of_a_tree_begin_at_the_nearest_value_within_their_limits():
    """A hand whose fingers start below their lower limits: in an MJCF at 0."""
    text = f"""<mujoco><compiler angle="degree"/><worldbody><body name="palm">{hinge("swing", -90, 90)}
      <geom size="0.1"/><body name="femur">{hinge("femur", 9.74, 120)}<geom size="0.1"/>
      <body name="knee">{hinge("knee", -100, -20)}<geom size="0.1"/></body></body></body></worldbody></mujoco>"""
    hand = cinegen.load(text)
    assert dict(hand.limits.exceeded(hand.q_home)) == {}
    assert np.degrees(hand.q_home) == pytest.approx([0.0, 9.74, -20.0])
    (note,) = [note for note in hand.source.notes if "home was moved" in note]
    assert "femur (0 deg, limit 9.74), knee (0 deg, limit -20)" in note
    solver = cinegen.Solver(hand, dt=0.01)
    task = solver.add_task("knee", translation=0)
    turn = np.array([[0.9, 0.0, np.sqrt(0.19)], [0.0, 1.0, 0.0], [-np.sqrt(0.19), 0.0, 0.9]])
    task.target.rotation = task.target.rotation @ turn
    for _ in range(30):
        solver.step()
    assert np.abs(solver.q - hand.q_home).max() > 1e-2


def test_raff2urdf_writes_the_same_home(tmp_path):
    import raff2urdf

    (tmp_path / "bars.raff").write_text(four_bar(-170.0, -10.0), encoding="utf-8")
    with pytest.warns(raff2urdf.RaffWarning, match="home 100 of link 4 is outside its limits"):
        (made,) = raff2urdf.convert(tmp_path / "bars.raff", tmp_path)
    assert cinegen.load(made.file).q_home == pytest.approx(cinegen.load(four_bar(-170.0, -10.0)).q_home, abs=1e-9)
