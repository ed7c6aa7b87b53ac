"""A robot in one HTML file, which can be rotated without a server and without this program."""

import tempfile
from pathlib import Path

import cinegen
from cinegen.cockpit import make_page

gough = cinegen.load("gough")
page, scene = make_page({"gough": gough})

solver = cinegen.Solver(gough, dt=1 / 60)
task = solver.add_task("platform")
task.target.translation += [0.05, 0.1, 0.1]  # m
for _ in range(60):
    solver.step()
scene.show("gough", solver.q)
scene.target("gough", "platform", task.target)

path = Path(tempfile.mkdtemp(), "gough.html")
path.write_text(page.html(), encoding="utf-8")
print(f"open {path} in a browser: {path.stat().st_size / 1e6:.1f} MB, the viewer included")
