"""Draws the robots of docs/gallery.md again: `python docs/pictures/make.py [ROBOT ...]`. Needs chromium on PATH.

Each is above the ground in the viewer of the cockpit, with its shadow, and its actuated joints are named. Some are
pulled away from home first. (`steps.py` draws the pictures of pages that follow the text above them.)
"""

import base64
import io
import math
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import umsgpack
from figures import PICTURES, ROBOTS, chromium, exif
from labels import write_labels
from meshcat import Visualizer
from meshcat.geometry import Cylinder
from PIL import Image, ImageChops

import cinegen
import raff2urdf
from cinegen.cockpit import make_page
from cinegen.cockpit.graphic_file import material
from cinegen.plotting.skeleton import Skeleton

PULLED = {"delta4": (0.5, 0.2, -1.6)}  # m, from home
FLAT = {"belt_five_bar", "cusp_3rpr", "five_bar", "four_bar", "planar_3r", "planar_hybrid", "planetary_gear"}
"""Robots that lie in the plane of x and y: seen from higher up."""
AZIMUTH = {"tssm": -52.0, "gough": -52.0, "rx90": -40.0, "sr400": -40.0, "arm7": -40.0, "ankle": -140.0}
SIZE, SHOT = (900, 600), (1350, 900)  # pixels: of a picture, and of what is drawn
GROUND, SHADOW = 0xE9ECF0, 0xC3C8CF
LARGEST = 60_000  # bytes
_GAP, _FLATNESS = 0.01, 1e-4  # of the size: below the robot; heights of the shadow
_MARGIN = 0.54  # half of a picture's width, relative to what is drawn
_ALL = "/meshcat/cinegen"  # all robots
_READY = "typeof viewer !== 'undefined' && viewer.scene !== undefined"
_PROJECT = """(points) => {
  viewer.scene.updateMatrixWorld(true);
  viewer.camera.updateMatrixWorld(true);
  return points.map(([x, y, z]) => {
    const point = viewer.camera.position.clone().set(x, z, -y).project(viewer.camera);
    return [(1 + point.x) / 2, (1 - point.y) / 2];
  });
}"""
"""Points of the world, z up, as fractions of the picture's width and height."""
_CORNERS = """() => {
  const points = [];
  viewer.scene.updateMatrixWorld(true);
  viewer.scene_tree.find(["meshcat", "cinegen"]).object.traverse((one) => {
    if (!one.isMesh) return;
    one.geometry.computeBoundingBox();
    const { min, max } = one.geometry.boundingBox;
    for (const x of [min.x, max.x]) for (const y of [min.y, max.y]) for (const z of [min.z, max.z]) {
      const corner = min.clone().set(x, y, z).applyMatrix4(one.matrixWorld);
      points.push([corner.x, -corner.z, corner.y]);
    }
  });
  return points;
}"""
"""Corners of the boxes around all that is drawn, z up."""
_SHOW = """([messages, eye, centre]) => {
  for (const text of messages) {
    viewer.handle_command_bytearray(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)));
  }
  viewer.camera.parent.position.set(0, 0, 0);
  viewer.camera.position.set(...eye);
  viewer.controls.target.set(...centre);
  viewer.controls.update();
  viewer.set_dirty();
}"""
"""Draw more, and put the camera at its place."""


def pulled(mechanism, offset):
    """The configuration after two seconds of pulling the robot's end towards an offset (m)."""
    solver = cinegen.Solver(mechanism, 1 / 60)
    task = solver.add_task(mechanism.sensor_constraints[0][0], rotation=0)
    task.target = pin.SE3(task.target.rotation, task.target.translation + np.array(offset))
    for _ in range(120):
        solver.step()
    return solver.q


def scaling(page):
    """Return the matrix (4, 4) by which the page scales and moves all robots."""
    messages = (umsgpack.unpackb(message) for message in page.scene().values())
    return next(
        np.array(message["matrix"]).reshape(4, 4).T
        for message in messages
        if (message["path"], message["type"]) == (_ALL, "set_transform")
    )


def ground(page, points):
    """Put a disc below all points, and on it the shadow of all that is drawn; return its height, middle and radius."""
    size = np.linalg.norm(np.ptp(points, axis=0))
    height, middle = points[:, 2].min() - _GAP * size, 0.5 * (points.min(axis=0) + points.max(axis=0))
    radius = 1.06 * max(np.linalg.norm(points[:, :2] - middle[:2], axis=1).max(), 0.3 * size)
    for message in page.scene().values():
        command = umsgpack.unpackb(message)
        if not command["path"].startswith(_ALL):
            continue
        command["path"] = command["path"].replace("/meshcat", "/shadow", 1)
        for look in command.get("object", {}).get("materials", ()):
            look.update(type="MeshBasicMaterial", color=SHADOW, opacity=1.0, transparent=False, vertexColors=0)
        page.send(SimpleNamespace(lower=lambda command=command: command))
    flat = np.diag([1.0, 1.0, _FLATNESS, 1.0])
    flat[2, 3] = height + 1e-3 * size
    window = Visualizer(window=page)
    window["/shadow"].set_transform(flat)
    disc = np.eye(4)
    disc[:3, :3] = pin.utils.rotate("x", 0.5 * math.pi)  # the viewer's cylinders are along y
    disc[:3, 3] = *middle[:2], height - 0.005 * size
    window["/ground"].set_object(Cylinder(0.01 * size, radius), material(GROUND))
    window["/ground"].set_transform(disc)
    return height, middle, radius


def look(page, azimuth, elevation, middle, height, radius, top):
    """Put the camera at a direction (degrees), so that disc and robot fill the picture."""
    window = Visualizer(window=page)
    window["/Grid"].set_property("visible", False)
    window["/Axes"].set_property("visible", False)
    window["/Background"].set_property("top_color", [1.0, 1.0, 1.0])
    window["/Background"].set_property("bottom_color", [1.0, 1.0, 1.0])
    azimuth, elevation = math.radians(azimuth), math.radians(elevation)
    centre = np.array([middle[0], middle[1], 0.5 * (height + top)])
    distance = 4.6 * max(radius, 0.75 * (top - height))
    eye = centre + distance * np.array(
        [math.cos(azimuth) * math.cos(elevation), math.sin(azimuth) * math.cos(elevation), math.sin(elevation)]
    )
    return [[x, z, -y] for x, y, z in (eye.tolist(), centre.tolist())]  # y up, as the viewer has it


def picture(browser, name):
    """Draw the robots of one file, with the names of their actuated joints."""
    path = ROBOTS / f"{name}.raff"
    robots, labels = {}, {}
    for robot in raff2urdf.load(path).robots:
        mechanism = cinegen.load(path, robot.name)
        q = pulled(mechanism, PULLED[name]) if name in PULLED else mechanism.q_home
        robots[robot.name] = mechanism, q
        data = mechanism.model.createData()
        pin.forwardKinematics(mechanism.model, data, q)
        slides = {slide.joint: slide.points.mean(axis=0) for slide in Skeleton(mechanism).at(q).slides}
        for joint in mechanism.actuated:
            point = slides.get(joint, data.oMi[mechanism.model.getJointId(joint)].translation)
            labels[robot.name, joint] = np.array(point)
    labels = {" ".join(key) if len(robots) > 1 else key[1]: point for key, point in labels.items()}
    azimuth = AZIMUTH.get(name, -72.0 if name in FLAT else -58.0)
    draw(browser, PICTURES / f"{name}.webp", robots, (azimuth, 48.0 if name in FLAT else 22.0), labels)


def draw(browser, path, robots, direction, labels=None, size=SIZE, add=None, description=""):
    """Write the picture of mechanisms at configurations, each with its name.

    `direction` of the camera: azimuth and elevation, degrees. `labels` are points (3,), m, by name. `add` takes the
    page and adds more to it. The file holds the description.
    """
    page, scene = make_page({name: mechanism for name, (mechanism, _) in robots.items()})
    for name, (_, q) in robots.items():
        scene.show(name, q)
    matrix, labels = scaling(page), labels or {}  # the matrix depends on where the robots are shown
    if add:
        add(page)
    labels = {label: (matrix[:3, :3] @ point + matrix[:3, 3]).tolist() for label, point in labels.items()}
    with tempfile.TemporaryDirectory() as folder:
        html = Path(folder, "page.html")
        html.write_text(page.html(), encoding="utf-8")
        tab = browser.new_page(viewport=dict(zip(("width", "height"), SHOT, strict=True)))
        tab.goto(html.as_uri(), timeout=180_000, wait_until="commit")
        tab.wait_for_function(_READY, timeout=180_000)
        tab.add_style_tag(content=".dg.main { display: none; }")
        tab.wait_for_timeout(1000)
        feed = page.feed()
        feed.take()  # what the file has
        points = np.array(tab.evaluate(_CORNERS))
        height, middle, radius = ground(page, points)
        eye, centre = look(page, *direction, middle, height, radius, points[:, 2].max())
        tab.evaluate(_SHOW, [[base64.b64encode(message).decode() for message in feed.take()], eye, centre])
        tab.wait_for_timeout(3000)
        flat = np.reshape(tab.evaluate(_PROJECT, list(labels.values())), (-1, 2)) * SHOT
        shot = tab.screenshot(timeout=180_000)
        tab.close()
    with Image.open(io.BytesIO(shot)) as image:
        cut, flat = cut_out(image.convert("RGB"), flat)
    drawn = write_labels(cut, dict(zip(labels, flat, strict=True)))
    small = drawn.resize(size, Image.Resampling.LANCZOS)
    small.save(path, quality=82, method=6, exif=exif(description) if description else b"")
    assert path.stat().st_size <= LARGEST, path
    print(f"{path.name}: {path.stat().st_size / 1000:.1f} kB")


def cut_out(image, points):
    """Return what is not white with a margin, as large as before, and where points (n, 2) are then."""
    left, top, right, bottom = ImageChops.difference(image, Image.new("RGB", image.size, "white")).getbbox()
    shape = SHOT[0] / SHOT[1]
    half = _MARGIN * max(right - left, shape * (bottom - top))
    corner = np.array([(left + right) / 2 - half, (top + bottom) / 2 - half / shape])
    padded = Image.new("RGB", (3 * image.width, 3 * image.height), "white")
    padded.paste(image, image.size)
    box = *(corner + image.size), *(corner + image.size + (2.0 * half, 2.0 * half / shape))
    cut = padded.resize(SHOT, Image.Resampling.LANCZOS, box=tuple(map(float, box)))
    return cut, (points - corner) * (SHOT[0] / (2.0 * half))


def main():
    """Draw those that the command line names, or all."""
    with chromium() as browser:
        for name in sys.argv[1:] or sorted(path.stem for path in ROBOTS.glob("*.raff")):
            picture(browser, name)


if __name__ == "__main__":
    main()
