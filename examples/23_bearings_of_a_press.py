"""Bearings of a four-bar press: the forces in its pins over a revolution, and what statics can't determine of them."""

import tempfile
from pathlib import Path

import numpy as np

import cinegen
from cinegen.plotting.sheet import BLUE, GREEN, ORANGE, VERMILION, finish, sheet

press = cinegen.load("four_bar")  # the point "tool" of its coupler presses, while it moves down
SPEED, RESISTANCE = 40.0, 1000.0  # rad/s of the crank, N
angles, results = np.radians(np.arange(0, 361, 3)), []

q = press.q_home.copy()
for angle in angles:
    q[press.q_index("joint1")] += angle - angles[max(0, len(results) - 1)]
    q = press.close(q, locked=["joint1"])
    motion = {"joint1": SPEED}, {"joint1": 0.0}
    velocity = press.jacobian(q, "tool")[:3] @ cinegen.InverseDynamics(press).motion(q, *motion)[0]
    is_down = (press.placement(q, "tool").rotation @ velocity)[1] < 0.0  # along the world's y
    work = cinegen.Payload("tool", wrench=(0, RESISTANCE * is_down, 0, 0, 0, 0))
    results.append(cinegen.forces(press, q, *motion, payloads=[work]))

torque = np.array([forces.torques[0] for forces in results])
print(f"the crank needs {torque.max():.1f} N m at most, {torque.mean():.1f} on average")
figure, body = sheet(6.0, 5.0, "Pins of a four-bar press", "forces in the plane (N) over the angle of the crank")
axes = body.subplots(subplot_kw={"projection": "polar"})
for name, color in {"joint1": BLUE, "joint2": ORANGE, "joint3": GREEN, "frame4-frame5": VERMILION}.items():
    force = np.array([forces.reaction(name).force for forces in results])
    size = np.linalg.norm(force[:, :2], axis=1)
    worst = np.degrees(results[int(size.argmax())].q[0]) % 360
    print(f"{name}: {size.max():.0f} N at most, with the crank at {worst:.0f} degrees")
    axes.plot(angles + press.q_home[0], size, color=color, label=name)
    assert np.isnan(force[:, 2]).all()  # along the pin
axes.set_rlabel_position(135)
finish(figure)
figure.savefig(Path(tempfile.mkdtemp()) / "bearings.png")
print("statics does not determine all of the reactions of", ", ".join(results[0].undetermined))
