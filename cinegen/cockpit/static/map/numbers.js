// Numbers of a map as texts.

import { units } from "../base/units.js";

const DIGITS = 3;
const SMALL = 1e-3;
const LARGE = 1e5;

/** Return a value with its unit; "1" is dimensionless. @param {number} value @param {string} unit */
export function formatted(value, unit) {
  if (!Number.isFinite(value)) return value === Infinity ? "∞" : "–";
  const size = Math.abs(value);
  const text = size !== 0 && (size < SMALL || size >= LARGE) ? value.toExponential(1) : String(Number(value.toPrecision(DIGITS)));
  return unit === "1" ? text : `${text} ${UNITS[unit] ?? unit}`;
}

/**
 * Return the coordinate of a cell along an axis, by its index among those that are shown.
 * @param {Pick<import("./field.js").Axis, "unit" | "low" | "step">} axis
 * @param {number} index
 */
export function valueOf({ unit, low, step }, index) {
  const value = low + index * step;
  return unit === "m" ? units.length(value) : units.angle(value);
}

/** @type {Record<string, string>} */
const UNITS = { "m s-1": "m/s" };
