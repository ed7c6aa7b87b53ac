// The known word that is most similar to another one: Ratcliff and Obershelp's measure, as Python's difflib counts it.

import { limits } from "./definitions.js";

const LEAST = 0.6; // of the measure: what is below is not similar

/**
 * The most similar of the known words; undefined if none is similar.
 *
 * @param {string} word
 * @param {readonly string[]} known
 */
export function closest(word, known) {
  const letters = Array.from(word);
  if (!letters.length || letters.length > limits.similarLength) return undefined;
  let best = LEAST;
  /** @type {string | undefined} */
  let found;
  const short = known.map((one) => Array.from(one)).filter((one) => one.length <= limits.similarLength);
  for (const other of short.slice(0, limits.similarWords)) {
    const similarity = measure(other, letters);
    const text = other.join("");
    if (similarity > best || (similarity === best && (found === undefined || follows(text, found)))) {
      [best, found] = [similarity, text];
    }
  }
  return found;
}

/**
 * Twice the number of letters in common blocks over the number of all letters.
 *
 * @param {string[]} a
 * @param {string[]} b
 */
function measure(a, b) {
  /** @type {Map<string, number[]>} */
  const places = new Map();
  b.forEach((letter, j) => places.set(letter, [...(places.get(letter) ?? []), j]));
  let matches = 0;
  const pending = [[0, a.length, 0, b.length]];
  for (let range = pending.pop(); range; range = pending.pop()) {
    const [aLow, aHigh, bLow, bHigh] = range;
    const { i, j, size } = longest(a, places, range);
    if (!size) continue;
    matches += size;
    pending.push([aLow, i, bLow, j], [i + size, aHigh, j + size, bHigh]);
  }
  return a.length + b.length ? (2 * matches) / (a.length + b.length) : 1;
}

/**
 * The longest block in both ranges; of several the first in `a`, and of these the first in `b`.
 *
 * @param {string[]} a
 * @param {Map<string, number[]>} places of each letter in `b`
 * @param {number[]} range
 */
function longest(a, places, [aLow, aHigh, bLow, bHigh]) {
  let best = { i: aLow, j: bLow, size: 0 };
  /** @type {Map<number, number>} */
  let lengths = new Map(); // of the blocks that end at each place of b and the letter of a before
  for (let i = aLow; i < aHigh; i++) {
    /** @type {Map<number, number>} */
    const next = new Map();
    for (const j of places.get(a[i]) ?? []) {
      if (j < bLow || j >= bHigh) continue;
      const size = (lengths.get(j - 1) ?? 0) + 1;
      next.set(j, size);
      if (size > best.size) best = { i: i - size + 1, j: j - size + 1, size };
    }
    lengths = next;
  }
  return best;
}

/**
 * Return whether a text follows another in the order of code points.
 *
 * @param {string} a
 * @param {string} b
 */
function follows(a, b) {
  const [x, y] = [Array.from(a), Array.from(b)];
  const i = x.findIndex((letter, at) => letter !== y[at]);
  return i >= 0 && (y[i] === undefined || (x[i].codePointAt(0) ?? 0) > (y[i].codePointAt(0) ?? 0));
}
