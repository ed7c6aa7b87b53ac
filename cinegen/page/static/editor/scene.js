// Robots of a text as they are drawn, in the way of cinegen/cockpit/scene.py: graphics of the page where the text names
// them, otherwise shapes from the robots' parameters.

import {
  BoxGeometry, BufferGeometry, CylinderGeometry, Float32BufferAttribute, LineBasicMaterial, LineSegments, Matrix4, Mesh,
  MeshLambertMaterial, SphereGeometry, Vector3,
} from "three";
import { segment } from "../../../cockpit/static/base/names.js";
import { motionPlane } from "./motion_plane.js";
import { nodesOf, placements } from "./placements.js";
import { skeletonOf } from "./skeleton.js";

const ROOT = ["meshcat", "cinegen"];
const SHOWN = 1.6; // m: radius at which everything is drawn
const EYE = [3.8, -4.9, 3]; // first position of the camera, m
const TILT = 1e-3; // of a camera that looks straight down, so that it has an upper side
const ZOOM = 2.2;
const LOOP = 0xcc79a7;
const AXES = [1, 0, 0, 1, 0.6, 0, 0, 1, 0, 0.6, 1, 0, 0, 0, 1, 0, 0.6, 1]; // colours: red x, green y, blue z

/** Shapes of size 1, which all skeletons share. */
const UNIT = {
  box: new BoxGeometry(1, 1, 1),
  cylinder: new CylinderGeometry(1, 1, 1, 50).rotateX(Math.PI / 2), // three.js's cylinders are along y
  sphere: new SphereGeometry(1, 20, 20),
};

/** @typedef {import("./reading.js").ReadRobot} ReadRobot */
/** @typedef {import("./skeleton.js").Shape} Shape */
/** @typedef {import("../../../cockpit/static/view/view.js").View} View */

/** A drawing of robots, instead of those drawn before. */
export class TextScene {
  #drawn = false;
  /** @type {(Mesh | LineSegments)[]} */
  #shown = [];

  /**
   * @param {View} view
   * @param {import("./graphics.js").GraphicFiles} files
   */
  constructor(view, files) {
    this.view = view;
    this.files = files;
  }

  /** @param {ReadRobot[]} robots */
  draw(robots) {
    const { viewer } = this.view;
    if (viewer.scene_tree.children[ROOT[0]] !== undefined) viewer.delete_path(ROOT);
    for (const one of this.#shown.splice(0)) {
      for (const material of [one.material].flat()) material.dispose();
      if (one instanceof LineSegments) one.geometry.dispose(); // others are shared
    }
    /** @type {Vector3[]} */
    const points = [];
    for (const robot of robots) points.push(...this.#robot(robot));
    this.#fit(points);
    if (!this.#drawn) this.#look(robots);
    this.#drawn = true;
    viewer.num_messages_received += 1; // the view looks for what was drawn
    this.view.changed();
  }

  /** @param {Vector3[]} points */
  #fit(points) {
    const low = points.reduce((least, point) => least.clone().min(point), points[0]);
    const high = points.reduce((most, point) => most.clone().max(point), points[0]);
    const centre = low.clone().add(high).multiplyScalar(0.5);
    const scale = SHOWN / (Math.max(...points.map((point) => point.distanceTo(centre))) || 1);
    const { viewer } = this.view;
    const root = viewer.scene_tree.find(ROOT).object;
    root.scale.setScalar(scale);
    root.position.copy(centre).multiplyScalar(-scale);
    viewer.scene_tree.find(["Grid"]).object.position.set(0, 0, scale * (low.z - centre.z) - 0.05);
    viewer.scene_tree.find(["Axes"]).object.visible = false;
  }

  /**
   * Set the first position of the camera: facing the plane in which all robots move, if any.
   *
   * @param {ReadRobot[]} robots
   */
  #look(robots) {
    const normals = robots.map(({ model, analysis: { home } }) => motionPlane(model, placements(model, home)))
      .map((normal) => normal && new Vector3(...normal));
    const eye = new Vector3(...EYE);
    const [normal] = normals;
    if (normal && normals.every((one) => one && Math.abs(one.dot(normal)) > 1 - 1e-9)) {
      eye.copy(normal).multiplyScalar(Math.sign(normal.dot(eye) || 1) * Math.hypot(...EYE));
      eye.y -= TILT;
    }
    const { camera } = this.view.viewer;
    camera.position.set(eye.x, eye.z, -eye.y); // y up
    camera.zoom = ZOOM;
    camera.updateProjectionMatrix();
  }

  /**
   * Draw a robot. Return points that bound it at home: its nodes, and the corners of its graphics.
   *
   * @param {ReadRobot} robot
   */
  #robot({ model, analysis: { home, length }, graphics }) {
    const { robot, bodies, loops, metre } = model;
    const { scene_tree: tree } = this.view.viewer;
    const show = (/** @type {string} */ node, /** @type {string} */ name, /** @type {Mesh | LineSegments} */ object) => {
      object.name = name;
      this.#shown.push(object);
      tree.find([...ROOT, segment(robot), segment(node)]).object.add(object); // not as a path of the viewer, which makes controls for each
    };
    const placed = placements(model, home);
    const shapes = skeletonOf(model);
    /** @type {Vector3[]} */
    const points = [];
    for (const [i, body] of bodies.entries()) {
      if (!body.isNode) continue; // between the joints of one of several variables: nothing is there
      const pose = matrixOf(/** @type {import("../raff/kleinfinger.js").Placement} */ (placed.get(body)));
      points.push(new Vector3().setFromMatrixPosition(pose));
      const keys = graphics.get(body.name) ?? null;
      if (keys === null) shapes[i].forEach((shape, k) => show(body.name, String(k), meshOf(shape)));
      const meshes = (keys ?? []).flatMap((key) => this.files.meshesOf(key));
      for (const [k, mesh] of meshes.entries()) {
        mesh.scale.setScalar(metre);
        show(body.name, String(k), mesh);
        points.push(...corners(mesh).map((corner) => corner.multiplyScalar(metre).applyMatrix4(pose)));
      }
    }
    const nodes = nodesOf(model);
    const followers = model.sensorConstraints.map(({ body }) => bodies[body]);
    for (const { name } of new Set([nodes[nodes.length - 1], ...followers])) show(name, "triad", triad(0.15 * length));
    for (const { name, first } of loops) show(bodies[first].name, segment(name, "loop "), loopMark(0.05 * length));
    return points;
  }
}

/** @param {import("../raff/kleinfinger.js").Placement} m */
function matrixOf(m) {
  return new Matrix4().fromArray([m[0], m[4], m[8], 0, m[1], m[5], m[9], 0, m[2], m[6], m[10], 0, m[3], m[7], m[11], 1]);
}

/** @param {Shape} shape */
function meshOf({ kind, size: [a, b = a, c = a], placement, colour }) {
  const mesh = new Mesh(UNIT[kind], new MeshLambertMaterial({ color: colour }));
  mesh.applyMatrix4(matrixOf(placement));
  if (kind === "cylinder") mesh.scale.set(a, a, b);
  else mesh.scale.set(a, b, c);
  return mesh;
}

/** @param {number} radius */
function loopMark(radius) {
  const mesh = new Mesh(UNIT.sphere, new MeshLambertMaterial({ color: LOOP, opacity: 0.6, transparent: true }));
  mesh.scale.setScalar(radius);
  return mesh;
}

/** @param {number} size */
function triad(size) {
  const lines = new BufferGeometry();
  const ends = [size, 0, 0, 0, size, 0, 0, 0, size];
  lines.setAttribute("position", new Float32BufferAttribute([0, 3, 6].flatMap((i) => [0, 0, 0, ...ends.slice(i, i + 3)]), 3));
  lines.setAttribute("color", new Float32BufferAttribute(AXES, 3));
  return new LineSegments(lines, new LineBasicMaterial({ vertexColors: true }));
}

/**
 * Return the corners of a mesh's bounding box, in its own axes.
 *
 * @param {Mesh} mesh
 */
function corners({ geometry }) {
  geometry.computeBoundingBox();
  const { min, max } = /** @type {import("three").Box3} */ (geometry.boundingBox);
  return [...Array(8).keys()].map((i) => new Vector3(...[0, 1, 2].map((k) => (i & (1 << k) ? max : min).getComponent(k))));
}
