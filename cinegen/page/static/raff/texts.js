// Fill in the texts of errors, as Python's str.format does.

import { limits, texts } from "./definitions.js";
import { closest } from "./similar_words.js";

/** @typedef {Record<string, string | number>} Fields */

/**
 * A text with its fields filled in: `{name}`, or a number to six significant digits or so as `{value:g}`, `{value:.3g}`.
 *
 * @param {string} template
 * @param {Fields} [fields]
 */
export function fill(template, fields = {}) {
  return template.replace(/\{\{|\}\}|\{(\w+)(?::(?:\.(\d+))?(g))?\}/g, (found, name, digits, general) => {
    if (name === undefined) return found[0];
    const value = fields[name];
    if (value === undefined) throw new TypeError(`a text lacks its field '${name}': ${template}`);
    if (general) return significant(Number(value), Number(digits ?? 6));
    return String(value);
  });
}

/**
 * A number as Python's format "g": some significant digits, no zeros at its end.
 *
 * @param {number} value
 * @param {number} digits
 */
export function significant(value, digits) {
  if (value === 0) return Object.is(value, -0) ? "-0" : "0";
  if (!Number.isFinite(value)) return Number.isNaN(value) ? "nan" : value < 0 ? "-inf" : "inf";
  const [mantissa, exponent] = toEven(value, digits - 1).split("e");
  const power = Number(exponent);
  const sign = mantissa.startsWith("-") ? "-" : "";
  const figures = mantissa.replace(/[-.]/g, "").replace(/0+$/, "");
  if (power < -4 || power >= digits) {
    const size = String(Math.abs(power)).padStart(2, "0");
    const point = figures.length > 1 ? `.${figures.slice(1)}` : "";
    return `${sign}${figures[0]}${point}e${power < 0 ? "-" : "+"}${size}`;
  }
  if (power < 0) return `${sign}0.${"0".repeat(-power - 1)}${figures}`;
  const before = figures.slice(0, power + 1).padEnd(power + 1, "0");
  const after = figures.slice(power + 1);
  return sign + before + (after ? `.${after}` : "");
}

/**
 * The same as `toExponential`, which rounds a tie up: here to the even digit.
 *
 * @param {number} value
 * @param {number} digits behind the point
 */
function toEven(value, digits) {
  const exact = value.toExponential(100);
  const first = exact.indexOf(".") + 1 + digits;
  const isTie = /^50*e/.test(exact.slice(first));
  const last = exact[digits > 0 ? first - 1 : first - 2];
  if (!isTie || Number(last) % 2 !== 0) return value.toExponential(digits);
  return exact.slice(0, digits > 0 ? first : first - 1) + exact.slice(exact.indexOf("e"));
}

/**
 * The shortest text that reads back to the same double, as Python writes it; whole numbers without a point.
 *
 * @param {number} value
 */
export function shortest(value) {
  const [mantissa, exponent] = value.toExponential().split("e");
  const power = Number(exponent);
  if (value !== 0 && (power < -4 || power >= 16)) {
    return `${mantissa}e${power < 0 ? "-" : "+"}${String(Math.abs(power)).padStart(2, "0")}`;
  }
  return Object.is(value, -0) ? "-0" : String(value);
}

/**
 * ": did you mean 'alpha'?", or a list of the known words if none is similar.
 *
 * @param {string} word
 * @param {readonly string[]} known
 */
export function didYouMean(word, known) {
  const near = closest(word, known);
  if (near !== undefined) return fill(texts.DID_YOU_MEAN, { word: near });
  if (!known.length) return "";
  const shown = known.slice(0, limits.knownWords).map((one) => start(one, limits.similarLength));
  return fill(texts.KNOWN, { listed: shown.join(", "), more: known.length > shown.length ? ", ..." : "" });
}

/**
 * The first characters of a text; a character is one code point.
 *
 * @param {string} text
 * @param {number} count
 */
export function start(text, count) {
  return text.length <= count ? text : Array.from(text.slice(0, 2 * count)).slice(0, count).join("");
}

/**
 * The number of characters of a text; a character is one code point.
 *
 * @param {string} text
 */
export function characters(text) {
  let count = text.length;
  for (const pair of text.matchAll(/[\ud800-\udbff][\udc00-\udfff]/g)) count -= pair[0].length - 1;
  return count;
}
