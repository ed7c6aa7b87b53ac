// Millimetres and degrees for people, or metres and radians; on the wire it is always m and rad.

import { Events } from "./events.js";
import { memory } from "./dom.js";

const DEGREE = Math.PI / 180;
const NAMES = ["mm · °", "m · rad"];

class Units extends Events {
  small = memory.get("units", "mm") === "mm"; // mm and degrees

  toggle() {
    this.small = !this.small;
    memory.set("units", this.small ? "mm" : "m");
    this.tell("change");
  }

  get name() {
    return this.small ? NAMES[0] : NAMES[1];
  }

  get other() {
    return this.small ? NAMES[1] : NAMES[0];
  }

  /** "12.3 mm" of a length in m. */
  length(metres) {
    return this.small ? `${fixed(1000 * metres, 1)} mm` : `${fixed(metres, 4)} m`;
  }

  angle(radians) {
    return this.small ? `${fixed(radians / DEGREE, 1)}°` : `${fixed(radians, 3)} rad`;
  }

  /** A joint's value as it is shown, without its unit. */
  shown(joint, value) {
    if (!this.small) return value;
    return joint.type === "prismatic" ? 1000 * value : value / DEGREE;
  }

  /** The other way round. */
  meant(joint, shown) {
    if (!this.small) return shown;
    return joint.type === "prismatic" ? shown / 1000 : shown * DEGREE;
  }

  digits(joint) {
    if (this.small) return 1;
    return joint.type === "prismatic" ? 4 : 3;
  }

  unit(joint) {
    if (joint.type === "prismatic") return this.small ? "mm" : "m";
    return this.small ? "°" : "rad";
  }

  joint(joint, value) {
    return joint.type === "prismatic" ? this.length(value) : this.angle(value);
  }

  speed(metresASecond) {
    return this.small ? `${significant(1000 * metresASecond)} mm/s` : `${significant(metresASecond)} m/s`;
  }

  turning(radiansASecond) {
    return this.small ? `${significant(radiansASecond / DEGREE)} °/s` : `${significant(radiansASecond)} rad/s`;
  }
}

/** With so many digits, and no "-0.0". */
export function fixed(value, digits) {
  if (!Number.isFinite(value)) return "–";
  const text = value.toFixed(digits);
  return Number(text) === 0 ? (0).toFixed(digits) : text;
}

/** Two significant digits, written out. */
export function significant(value) {
  return Number.isFinite(value) ? String(Number(value.toPrecision(2))) : "–";
}

export const units = new Units();
