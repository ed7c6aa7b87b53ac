// Names that people type: one line of plain text, as cinegen/session/commands.py accepts it. It becomes text, never markup.
// Names of robots and links in the paths of the viewer's scene.

export const LONGEST = 40; // characters
const SHARED = 3; // names with the same beginning: it is cut

// Control characters, and those that reverse the direction of text.
const REFUSED = /[\p{Cc}\u200e\u200f\u2028-\u202e\u2066-\u2069]|\p{Surrogate}/gu;

/** Return a name that the session accepts; empty if nothing of the text is left. @param {string} text */
export function cleanName(text) {
  const line = text.replace(REFUSED, " ").replace(/\s+/g, " ").trim();
  return [...line].slice(0, LONGEST).join("").trim();
}

/**
 * Return a name, behind a prefix, as one segment of a path of the viewer's scene, as `path_segment` of raff2urdf/escape.py
 * does: the viewer keeps nodes in objects, in which `constructor` is taken.
 * @param {string} name
 * @param {string} [prefix]
 */
export function segment(name, prefix = ":") {
  return prefix + name.replaceAll("%", "%25").replaceAll("/", "%2F");
}

/** Return the name in a segment with the usual prefix. @param {string} text */
export function nameOf(text) {
  return text.slice(1).replaceAll("%2F", "/").replaceAll("%25", "%");
}

/**
 * Return the length of what a list of names need not repeat: for each name, the longest beginning up to a separator that at
 * least three of them share.
 * @param {string[]} names
 * @returns {number[]}
 */
export function sharedBeginnings(names) {
  /** @type {Map<string, number>} */
  const counts = new Map();
  const beginnings = names.map((name) => [...name.matchAll(/[^_\-./: ][_\-./: ]+(?=[^_\-./: ])/g)].map((match) => name.slice(0, match.index + match[0].length)));
  for (const all of beginnings) for (const beginning of all) counts.set(beginning, (counts.get(beginning) ?? 0) + 1);
  return beginnings.map((all) => all.findLast((beginning) => (counts.get(beginning) ?? 0) >= SHARED)?.length ?? 0);
}

/**
 * Return the value that a record, by names of robots or joints, has of a name; undefined if it has none. Each object has a
 * `constructor` that nobody gave it.
 * @template T
 * @param {Record<string, T> | null | undefined} record
 * @param {string} name
 * @returns {T | undefined}
 */
export function valueOf(record, name) {
  return record && Object.hasOwn(record, name) ? record[name] : undefined;
}
