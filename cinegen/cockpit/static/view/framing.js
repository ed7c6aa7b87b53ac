// Where the camera must be for everything to fill a share of the view: the smallest pyramid, of given slopes and a given
// direction, around all vertices that are drawn.

import { Matrix3, Mesh, Vector3 } from "three";

/**
 * @typedef {{ left: number, right: number, bottom: number, top: number }} Rectangle
 * @typedef {import("three").PerspectiveCamera} Camera
 */

export class Pyramid {
  #right = new Vector3();
  #up = new Vector3();
  #back = new Vector3();
  /** @type {Vector3[]} */
  #normals; // of its right, left, upper and lower side, then along the view and against it
  #most = Array(6).fill(-Infinity); // how far everything extends along them
  #slopes;

  /**
   * @param {Camera} camera its direction and its angles are those of the pyramid
   * @param {Rectangle} within part of the view, in which -1 to 1 is all of it
   */
  constructor(camera, { left, right, bottom, top }) {
    camera.updateWorldMatrix(true, false);
    camera.matrixWorld.extractBasis(this.#right, this.#up, this.#back);
    const high = Math.tan((camera.fov * Math.PI) / 360) / (camera.zoom || 1);
    const wide = high * camera.aspect;
    this.#slopes = [wide * right, -wide * left, high * top, -high * bottom];
    const sides = [this.#right, this.#right.clone().negate(), this.#up, this.#up.clone().negate()];
    const normals = sides.map((side, i) => side.clone().addScaledVector(this.#back, this.#slopes[i]));
    this.#normals = [...normals, this.#back, this.#back.clone().negate()];
  }

  get empty() {
    return this.#most[0] === -Infinity;
  }

  /** @param {import("three").Box3} box in three's own axes */
  addBox({ min, max }) {
    this.#normals.forEach((normal, i) => {
      const far = (normal.x < 0 ? min : max).x * normal.x + (normal.y < 0 ? min : max).y * normal.y + (normal.z < 0 ? min : max).z * normal.z;
      this.#most[i] = Math.max(this.#most[i], far);
    });
  }

  /**
   * Add what an object and those below it draw; vertices are looked at where their box extends farther than all before.
   * @param {import("three").Object3D} object
   */
  add(object) {
    object.traverse((mesh) => {
      if (!(mesh instanceof Mesh) || mesh.geometry.getAttribute("position") === undefined) return;
      const { geometry, matrixWorld } = mesh;
      if (geometry.boundingBox === null) geometry.computeBoundingBox();
      const { min, max } = /** @type {import("three").Box3} */ (geometry.boundingBox);
      const turn = new Matrix3().setFromMatrix4(matrixWorld).transpose();
      const origin = new Vector3().setFromMatrixPosition(matrixWorld);
      const { array, itemSize } = geometry.getAttribute("position");
      this.#normals.forEach((normal, side) => {
        const { x, y, z } = normal.clone().applyMatrix3(turn);
        const from = normal.dot(origin);
        const box = Math.max(min.x * x, max.x * x) + Math.max(min.y * y, max.y * y) + Math.max(min.z * z, max.z * z);
        if (!(from + box > this.#most[side])) return;
        let most = this.#most[side];
        for (let i = 0; i < array.length; i += itemSize) most = Math.max(most, from + x * array[i] + y * array[i + 1] + z * array[i + 2]);
        this.#most[side] = most;
      });
    });
  }

  /** Whether it contains another of the same camera, seen from a place. @param {Vector3} place */
  isWithin(place) {
    return this.#normals.slice(0, 4).every((normal, i) => this.#most[i] <= normal.dot(place));
  }

  /** Return its tip, and the point in the middle of everything on its axis. */
  place() {
    const [right, left, top, bottom, near, far] = this.#most;
    const [r, l, t, b] = this.#slopes;
    const away = Math.max((right + left) / (r + l), (top + bottom) / (t + b));
    const x = (right - left + (l - r) * away) / 2;
    const y = (top - bottom + (b - t) * away) / 2;
    const at = (/** @type {number} */ z) => new Vector3().addScaledVector(this.#right, x).addScaledVector(this.#up, y).addScaledVector(this.#back, z);
    return { position: at(away), middle: at((near - far) / 2) };
  }
}
