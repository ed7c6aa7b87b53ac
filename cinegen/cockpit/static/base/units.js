// Millimetres and degrees for people, or metres and radians; on the wire it is always m and rad.

import { Events } from "./events.js";
import { memory } from "./dom.js";

const DEGREE = Math.PI / 180;
const NAMES = ["mm · °", "m · rad"];

/** @typedef {{ type: string }} Joint revolute, or prismatic */

/** @extends {Events<{ change: undefined }>} */
export class Units extends Events {
  small = memory.get("units", "mm") === "mm"; // mm and degrees

  toggle() {
    this.small = !this.small;
    memory.set("units", this.small ? "mm" : "m");
    this.emit("change");
  }

  get name() {
    return this.small ? NAMES[0] : NAMES[1];
  }

  get other() {
    return this.small ? NAMES[1] : NAMES[0];
  }

  /** "12.3 mm" of a length in m. @param {number} metres */
  length(metres) {
    return this.small ? `${fixed(1000 * metres, 1)} mm` : `${fixed(metres, 4)} m`;
  }

  /** @param {number} radians */
  angle(radians) {
    return this.small ? `${fixed(radians / DEGREE, 1)}°` : `${fixed(radians, 3)} rad`;
  }

  /** A joint's value as it is shown, without its unit. @param {Joint} joint @param {number} value */
  shown(joint, value) {
    if (!this.small) return value;
    return joint.type === "prismatic" ? 1000 * value : value / DEGREE;
  }

  /** The other way round. @param {Joint} joint @param {number} shown */
  meant(joint, shown) {
    if (!this.small) return shown;
    return joint.type === "prismatic" ? shown / 1000 : shown * DEGREE;
  }

  /** @param {Joint} joint */
  digits(joint) {
    if (this.small) return 1;
    return joint.type === "prismatic" ? 4 : 3;
  }

  /** @param {Joint} joint */
  unit(joint) {
    if (joint.type === "prismatic") return this.small ? "mm" : "m";
    return this.small ? "°" : "rad";
  }

  /** @param {Joint} joint @param {number} value */
  joint(joint, value) {
    return joint.type === "prismatic" ? this.length(value) : this.angle(value);
  }

  /** @param {number} metresASecond */
  speed(metresASecond) {
    return this.small ? `${significant(1000 * metresASecond)} mm/s` : `${significant(metresASecond)} m/s`;
  }

  /** @param {number} radiansASecond */
  turning(radiansASecond) {
    return this.small ? `${significant(radiansASecond / DEGREE)} °/s` : `${significant(radiansASecond)} rad/s`;
  }
}

/** With so many digits, and no "-0.0". @param {number} value @param {number} digits */
export function fixed(value, digits) {
  if (!Number.isFinite(value)) return "–";
  const text = value.toFixed(digits);
  return Number(text) === 0 ? (0).toFixed(digits) : text;
}

/** Two significant digits, written out. @param {number} value */
export function significant(value) {
  return Number.isFinite(value) ? String(Number(value.toPrecision(2))) : "–";
}

/**
 * A force or a torque with three significant digits: "642 N m", "12.3 kN".
 * @param {number} value
 * @param {string} unit
 */
export function amount(value, unit) {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  const [power, prefix] = size >= 9.995e6 ? [1e6, "M"] : size >= 9995 ? [1e3, "k"] : [1, ""];
  const text = size < 5e-4 ? "0" : String(Number((value / power).toPrecision(3)));
  return `${text} ${prefix}${unit}`;
}

const SEEN = [0.012, 0.06]; // characteristic lengths, rad

/**
 * Return whether a target is reached as far as people see.
 * @param {readonly number[]} error distance (m) and rotation (rad) to the target
 * @param {number} length characteristic length of the robot (m)
 */
export function isNear([far = 0, turned = 0], length) {
  return far <= SEEN[0] * length && turned <= SEEN[1];
}

export const units = new Units();
