// Where the robots' world is in the room of a headset: a shift, a rotation about the vertical and a scale of the scene.
// "Room" is what the headset measures: m, y up, the floor at 0.

import { Box3, Object3D, Quaternion, Vector3 } from "three";

const UP = new Vector3(0, 1, 0);
const SIZE = 0.8; // m: what the robots are as large as at first
const AHEAD = 0.9; // m, from the head to their middle
const BELOW = 0.35; // m, from the head
const FLOOR = 0.05; // m: they are at least so far above it
const ZOOM = 50; // times smaller or larger than at first

export class World {
  #turn; // of the scene in the page
  #angle = 0; // rad, about the vertical
  #position = new Vector3();
  #scale = 1;
  #first = 1; // scale that fits
  #middle = new Vector3(); // of the robots, in the page's own axes
  room = new Object3D(); // its children are drawn in the room's axes

  /** @param {View} view */
  constructor(view) {
    this.view = view;
    this.scene = view.viewer.scene;
    this.#turn = this.scene.quaternion.clone();
    this.room.matrixAutoUpdate = false;
  }

  /** Metres of the room per metre of the robots. */
  get scale() {
    return this.view.root.scale.x * this.#scale;
  }

  /** Middle of the robots, as they were when they were placed, in the room. */
  get middle() {
    return this.#middle.clone().multiplyScalar(this.#scale).applyAxisAngle(UP, this.#angle).add(this.#position);
  }

  /** Place the robots in front of a head. @param {Vector3} head in the room @param {Vector3} toward where it looks */
  place(head, toward) {
    this.restore();
    this.scene.add(this.room);
    const box = this.view.bounds(new Box3());
    if (box.isEmpty()) box.setFromCenterAndSize(new Vector3(), new Vector3(1, 1, 1));
    const size = box.getSize(new Vector3());
    this.#scale = this.#first = SIZE / Math.max(size.x, size.y, size.z);
    box.getCenter(this.#middle);
    this.#angle = Math.atan2(-toward.x, -toward.z);
    const at = new Vector3(toward.x, 0, toward.z).setLength(AHEAD).add(head);
    at.y = Math.max(head.y - BELOW, FLOOR + 0.5 * size.y * this.#scale);
    this.#position.add(at.sub(this.middle));
    this.#apply();
  }

  /** Put the scene back to where the page has it. */
  restore() {
    this.scene.remove(this.room);
    this.#angle = 0;
    this.#scale = 1;
    this.#position.set(0, 0, 0);
    this.#apply();
  }

  /** @param {Vector3} way in the room */
  move(way) {
    this.#position.add(way);
    this.#apply();
  }

  /** Scale the world about a point of the room. @param {number} factor @param {Vector3} pivot */
  zoom(factor, pivot) {
    const scale = Math.min(ZOOM * this.#first, Math.max(this.#first / ZOOM, this.#scale * factor));
    this.#position.sub(pivot).multiplyScalar(scale / this.#scale).add(pivot);
    this.#scale = scale;
    this.#apply();
  }

  /**
   * Rotate the world about a vertical line.
   * @param {number} angle rad
   * @param {Vector3} pivot a point of the line, in the room
   */
  rotate(angle, pivot) {
    this.#position.sub(pivot).applyAxisAngle(UP, angle).add(pivot);
    this.#angle += angle;
    this.#apply();
  }

  /**
   * Return the pose in the robots' world of a pose in the room.
   * @param {Vector3} position
   * @param {Quaternion} quaternion
   * @returns {[Vector3, Quaternion]}
   */
  inside(position, quaternion) {
    const { root } = this.view;
    const back = root.getWorldQuaternion(new Quaternion()).invert();
    return [root.worldToLocal(position.clone()), back.multiply(quaternion).normalize()];
  }

  #apply() {
    const { scene } = this;
    scene.quaternion.setFromAxisAngle(UP, this.#angle).multiply(this.#turn);
    scene.scale.setScalar(this.#scale);
    scene.position.copy(this.#position);
    scene.updateMatrixWorld(true);
    this.room.matrix.copy(scene.matrixWorld).invert();
    this.room.matrixWorldNeedsUpdate = true;
  }
}
