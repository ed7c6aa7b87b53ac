// A placement: the position (m) and the orientation of a frame in another.

import { Quaternion, Vector3 } from "three";

export class Placement {
  /** @param {Vector3} position @param {Quaternion} rotation of length 1 */
  constructor(position = new Vector3(), rotation = new Quaternion()) {
    this.position = position;
    this.rotation = rotation;
  }

  /**
   * Return the placement of seven numbers: x y z and a quaternion x y z w.
   * @param {ArrayLike<number>} numbers
   * @param {number} at where they begin
   */
  static of(numbers, at = 0) {
    const [x, y, z, a, b, c, d] = Array.from({ length: 7 }, (_, i) => numbers[at + i]);
    return new Placement(new Vector3(x, y, z), new Quaternion(a, b, c, d).normalize());
  }

  /** Return the placement on the way to another one. @param {Placement} goal @param {number} x 0 here, 1 there */
  towards(goal, x) {
    return new Placement(this.position.clone().lerp(goal.position, x), this.rotation.clone().slerp(goal.rotation, x));
  }

  /** Return its seven numbers. */
  numbers() {
    return /** @type {[number, number, number, number, number, number, number]} */ ([
      ...this.position.toArray(),
      ...this.rotation.toArray(),
    ]);
  }

  /** Return the placement of a frame that is placed in this one. @param {Placement} inner */
  times(inner) {
    return new Placement(this.act(inner.position), this.rotation.clone().multiply(inner.rotation).normalize());
  }

  /** Return the placement in this frame of a frame that is placed beside it. @param {Placement} outer */
  inverseTimes(outer) {
    const back = this.rotation.clone().conjugate();
    const position = outer.position.clone().sub(this.position).applyQuaternion(back);
    return new Placement(position, back.multiply(outer.rotation).normalize());
  }

  /** Return a point of this frame. @param {Vector3} point */
  act(point) {
    return point.clone().applyQuaternion(this.rotation).add(this.position);
  }

  clone() {
    return new Placement(this.position.clone(), this.rotation.clone());
  }
}
