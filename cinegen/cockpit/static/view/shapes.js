// Simple shapes that the page itself draws: never lit, never picked, seen through parts where they must be.

import {
  ConeGeometry,
  CylinderGeometry,
  Group,
  Mesh,
  MeshBasicMaterial,
  Quaternion,
  SphereGeometry,
  TorusGeometry,
  Vector3,
} from "three";

const UP = new Vector3(0, 1, 0); // cylinders and cones stand along it
const TURN = 1.6 * Math.PI; // of a twist's arc

/** @typedef {MeshBasicMaterial} Material */

const GEOMETRY = {
  ball: new SphereGeometry(1, 20, 14),
  rod: new CylinderGeometry(1, 1, 1, 10).translate(0, 0.5, 0),
  tip: new ConeGeometry(1, 2.4, 16).translate(0, 1.2, 0),
  arc: new TorusGeometry(1, 0.05, 8, 40, TURN),
};

/**
 * A flat colour; `through` is seen through parts.
 * @param {number} colour
 * @param {{ opacity?: number, through?: boolean }} options
 */
export function paint(colour, { opacity = 1, through = true } = {}) {
  return new MeshBasicMaterial({
    color: colour,
    opacity,
    transparent: true,
    depthTest: !through,
    depthWrite: false,
    toneMapped: false,
  });
}

/** @param {keyof typeof GEOMETRY} kind @param {Material} material */
function mesh(kind, material) {
  const made = new Mesh(GEOMETRY[kind], material);
  made.renderOrder = 10;
  return made;
}

/** @param {Material} material @param {number} radius */
export function ball(material, radius) {
  const made = mesh("ball", material);
  made.scale.setScalar(radius);
  return made;
}

/** A rod between two points, to be placed by `span`. @param {Material} material */
export function rod(material) {
  return mesh("rod", material);
}

/** @param {import("three").Object3D} made @param {Vector3} from @param {Vector3} to @param {number} radius */
export function span(made, from, to, radius) {
  const way = to.clone().sub(from);
  const length = way.length();
  made.visible = length > 1e-9;
  if (!made.visible) return;
  made.position.copy(from);
  made.quaternion.setFromUnitVectors(UP, way.divideScalar(length));
  made.scale.set(radius, length, radius);
}

/** An arrow both ways along y, 2 long: no motion to either side. @param {Material} material */
export function twoWays(material) {
  const group = new Group();
  for (const side of [1, -1]) {
    const half = new Group();
    const shaft = rod(material);
    shaft.scale.set(0.035, 0.8, 0.035);
    const tip = mesh("tip", material);
    tip.scale.setScalar(0.085);
    tip.position.y = 0.79;
    half.add(shaft, tip);
    half.rotation.x = side === 1 ? 0 : Math.PI;
    group.add(half);
  }
  return group;
}

/** An arc about y with a tip at each end, of radius 1. @param {Material} material */
export function twist(material) {
  const group = new Group();
  const arc = mesh("arc", material);
  arc.rotation.x = Math.PI / 2;
  group.add(arc);
  for (const [angle, way] of [[TURN, 1], [0, -1]]) {
    const tip = mesh("tip", material);
    tip.scale.setScalar(0.12);
    tip.position.set(Math.cos(angle), 0, Math.sin(angle));
    tip.quaternion.setFromUnitVectors(UP, new Vector3(-Math.sin(angle) * way, 0, Math.cos(angle) * way));
    group.add(tip);
  }
  return group;
}

/** An arrow along y from the origin, to be given its size by `stretch`. @param {Material} material */
export function arrow(material) {
  const group = new Group();
  group.add(rod(material), mesh("tip", material));
  return group;
}

/**
 * Give an arrow a length and a radius of its shaft; a short one is thinner.
 * @param {Group} made
 * @param {number} length
 * @param {number} radius
 */
export function stretch(made, length, radius) {
  const wide = Math.min(radius, 0.08 * length);
  const [shaft, tip] = made.children;
  tip.scale.setScalar(2.6 * wide);
  tip.position.y = length - 2.6 * 2.4 * wide;
  shaft.scale.set(wide, tip.position.y, wide);
}

/** Turns what stands along y along a direction. @param {import("three").Object3D} object @param {Vector3} direction */
export function along(object, direction) {
  const unit = direction.clone().normalize();
  if (unit.lengthSq() > 0) object.quaternion.copy(new Quaternion().setFromUnitVectors(UP, unit));
}
