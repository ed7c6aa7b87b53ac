"""Draws docs/pictures/*.png again: `python docs/pictures/make.py [ROBOT ...]`. Needs chromium on PATH, and Pillow.

The robots stand in the page that `cinegen drive --snapshot` writes, without its floor, seen from further away, and cut
out. Some are pulled away from home first.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pinocchio as pin
from PIL import Image, ImageChops

import cinegen
import raff2urdf
from cinegen.cockpit import make_page
from cinegen.cockpit.drawing import SceneNode

PICTURES = Path(__file__).resolve().parent
ROBOTS = PICTURES.parent.parent / "robots"
PULLED = {"delta4": (0.5, 0.2, -1.6)}  # m, from home
CHROMIUM = [
    *("chromium", "--headless", "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader"),
    *("--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--window-size=1800,1200", "--virtual-time-budget=8000"),
]
HIDDEN = "<style>.dg.main { display: none; }</style></head>"  # the viewer's own controls


def pulled(mechanism, offset):
    """The configuration after two seconds of pulling the robot's end towards an offset (m)."""
    solver = cinegen.Solver(mechanism, 1 / 60)
    task = solver.add_task(mechanism.sensor_constraints[0][0], rotation=0)
    task.target = pin.SE3(task.target.rotation, task.target.translation + np.array(offset))
    for _ in range(120):
        solver.step()
    return solver.q


def picture(name):
    """Draws the robots of one file."""
    path = ROBOTS / f"{name}.raff"
    mechanisms = {robot.name: cinegen.load(path, robot.name) for robot in raff2urdf.load(path).robots}
    page, scene = make_page(mechanisms)
    for key, mechanism in mechanisms.items():
        if name in PULLED:
            scene.show(key, pulled(mechanism, PULLED[name]))
    window = SceneNode(page)
    window["/Grid"].set_property("visible", False)
    window["/Background"].set_property("top_color", [1.0, 1.0, 1.0])
    window["/Cameras/default/rotated/<object>"].set_property("position", [3.8, 3.0, 4.9])  # m, y up
    window["/Cameras/default/rotated/<object>"].set_property("zoom", 2.4)
    with tempfile.TemporaryDirectory() as folder:
        html, png = Path(folder, "page.html"), Path(folder, "page.png")
        html.write_text(page.html().replace("</head>", HIDDEN), encoding="utf-8")
        command = [*CHROMIUM, f"--user-data-dir={folder}/profile", f"--screenshot={png}", html.as_uri()]
        subprocess.run(command, check=True, capture_output=True, timeout=120)
        with Image.open(png) as image:
            cut = cut_out(image.convert("RGB")).resize((900, 600), Image.Resampling.LANCZOS)
    cut.quantize(128, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(PICTURES / f"{name}.png", optimize=True)


def cut_out(image):
    """What is not white, with a margin, three to two."""
    left, top, right, bottom = ImageChops.difference(image, Image.new("RGB", image.size, "white")).getbbox()
    half = 0.55 * max(right - left, 1.5 * (bottom - top))
    x, y = (left + right) / 2, (top + bottom) / 2
    padded = Image.new("RGB", (3 * image.width, 3 * image.height), "white")
    padded.paste(image, image.size)
    x, y = x + image.width, y + image.height
    return padded.crop((round(x - half), round(y - half / 1.5), round(x + half), round(y + half / 1.5)))


if __name__ == "__main__":
    for robot in sys.argv[1:] or sorted(path.stem for path in ROBOTS.glob("*.raff")):
        picture(robot)
