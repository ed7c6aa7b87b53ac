// Robots drawn from their Kleinfinger parameters, as raff2urdf/graphics/skeleton.py draws links without graphics.

import { CylinderGeometry, Mesh, MeshLambertMaterial, SphereGeometry, Vector3 } from "three";
import { placements } from "./placements.js";

const ROOT = ["meshcat", "cinegen"];
const SHOWN = 1.6; // m: radius at which everything is drawn
const BRANCHES = [0x295970, 0xa88c59, 0xa89ed4, 0x6bbab0, 0x784a29, 0x63544d]; // those of skeleton.py
const EYE = /** @type {const} */ ([3.8, 3, 4.9]); // first position of the camera, m, y up
const JOINT = 0x333840;
const LOOP = 0xcc79a7;

/** @typedef {import("./reading.js").Model} Model */
/** @typedef {import("./reading.js").Analysis} Analysis */
/** @typedef {import("../../../cockpit/static/view/view.js").View} View */

/** A drawing of robots, instead of those drawn before. */
export class Skeletons {
  #drawn = false;

  /** @param {View} view */
  constructor(view) {
    this.view = view;
  }

  /** @param {{ model: Model, analysis: Analysis }[]} robots */
  draw(robots) {
    const { viewer } = this.view;
    if (viewer.scene_tree.children[ROOT[0]] !== undefined) viewer.delete_path(ROOT);
    const points = robots.flatMap(({ model, analysis: { home } }) =>
      [...placements(model, home).values()].map((m) => new Vector3(m[3], m[7], m[11])));
    this.#fit(points);
    for (const { model, analysis } of robots) this.#robot(model, analysis);
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
    if (this.#drawn) return;
    this.#drawn = true;
    this.view.camera.position.set(...EYE);
  }

  /**
   * @param {Model} model
   * @param {Analysis} analysis
   */
  #robot({ robot, bodies, joints, loops }, { length }) {
    const sizes = bodies.flatMap(({ parameters: { epsilon, d, r } }) => [epsilon, d, r].map(Math.abs)).filter((one) => one > 1e-12);
    const radius = 0.06 * (sizes.sort((a, b) => a - b)[Math.floor(sizes.length / 2)] ?? 1);
    const colours = coloursOf(bodies);
    bodies.forEach((body, i) => {
      /** @type {Mesh[]} */
      const parts = body.isNode ? [...jointOf(body, joints, radius)] : [];
      for (const child of bodies.filter(({ parent }) => parent === i)) parts.push(...pathTo(child, joints, radius, colours[i]));
      if (parts.length === 0 && body.parent >= 0) parts.push(ball(new Vector3(), 1.2 * radius, colours[i])); // to be dragged
      if (loops.some(({ first }) => first === i)) parts.push(ball(new Vector3(), 0.05 * length, LOOP, 0.6));
      if (!body.isNode) return; // between the joints of one of several variables: nothing is there
      parts.forEach((part, k) => this.view.viewer.set_object([...ROOT, robot, body.name, String(k)], part));
    });
  }
}

/** @param {Model["bodies"]} bodies */
function coloursOf(bodies) {
  const forks = new Map();
  let last = 0;
  /** @type {number[]} */
  const branch = [];
  const find = (/** @type {number} */ i) => {
    if (branch[i] !== undefined) return branch[i];
    const { parent } = bodies[i];
    if (parent < 0) return (branch[i] = 0);
    const own = find(parent);
    branch[i] = forks.has(parent) ? (last += 1) : own;
    forks.set(parent, true);
    return branch[i];
  };
  return bodies.map(({ parent }, i) => (parent < 0 ? 0x737880 : BRANCHES[find(i) % BRANCHES.length]));
}

/**
 * @param {import("../raff/model.js").Body} body
 * @param {Model["joints"]} joints
 * @param {number} radius
 */
function* jointOf({ joint }, joints, radius) {
  if (joint < 0) return;
  const { type, home } = joints[joint];
  const half = new Vector3(0, 0, 1.6 * radius);
  yield* bar(half.clone().negate(), half, (type === "prismatic" ? 1.8 : 1.5) * radius, JOINT);
  if (type === "prismatic") yield* bar(new Vector3(0, 0, -0.62 * home), new Vector3(), 0.6 * radius, JOINT);
}

/**
 * Yield bars from a body's origin to the joint of a child.
 *
 * @param {import("../raff/model.js").Body} child
 * @param {Model["joints"]} joints
 * @param {number} radius
 * @param {number} colour
 */
function* pathTo({ parameters: { gamma, epsilon, alpha, d, r }, joint }, joints, radius, colour) {
  const axis = new Vector3(Math.sin(gamma) * Math.sin(alpha), -Math.cos(gamma) * Math.sin(alpha), Math.cos(alpha));
  const slides = joint >= 0 && joints[joint].type === "prismatic";
  const foot = new Vector3(0, 0, epsilon);
  const knee = foot.clone().add(new Vector3(Math.cos(gamma), Math.sin(gamma), 0).multiplyScalar(d));
  const end = knee.clone().addScaledVector(axis, slides ? 0.55 * r : r);
  const corners = joint < 0 ? [new Vector3(), end] : [new Vector3(), foot, knee, end];
  for (const [i, corner] of corners.slice(1).entries()) {
    const before = [...bar(corners[i], corner, radius, colour)];
    yield* before;
    if (before.length > 0) yield ball(corner, radius, colour);
  }
}

/**
 * @param {Vector3} start
 * @param {Vector3} end
 * @param {number} radius
 * @param {number} colour
 */
function* bar(start, end, radius, colour) {
  const along = end.clone().sub(start);
  const length = along.length();
  if (length < 1e-6 * radius) return;
  const mesh = new Mesh(new CylinderGeometry(radius, radius, length, 20), new MeshLambertMaterial({ color: colour }));
  mesh.position.copy(start).add(end).multiplyScalar(0.5);
  mesh.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), along.divideScalar(length));
  yield mesh;
}

/**
 * @param {Vector3} centre
 * @param {number} radius
 * @param {number} colour
 */
function ball(centre, radius, colour, opacity = 1) {
  const look = new MeshLambertMaterial({ color: colour, opacity, transparent: opacity < 1 });
  const mesh = new Mesh(new SphereGeometry(radius, 16, 12), look);
  mesh.position.copy(centre);
  return mesh;
}
