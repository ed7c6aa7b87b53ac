"""A picture that turns: a robot in one HTML file, which needs neither a server nor this program any more."""

import tempfile
from pathlib import Path

import cinegen
from cinegen.cockpit import make_page

gough = cinegen.load("gough")
page, scene = make_page({"gough": gough})

solver = cinegen.Solver(gough, dt=1 / 60)
hand = solver.add_task("platform")
hand.target.translation += [0.05, 0.1, 0.1]  # m
for _ in range(60):
    solver.step()
scene.show("gough", solver.q)
scene.target("gough", "platform", hand.target)

path = Path(tempfile.mkdtemp(), "gough.html")
path.write_text(page.html(), encoding="utf-8")
print(f"open {path} in a browser: {path.stat().st_size / 1e6:.1f} MB, the viewer included")
