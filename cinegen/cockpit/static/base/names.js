// Names that people type: one line of plain text, as cinegen/session/commands.py accepts it. It becomes text, never markup.

export const LONGEST = 40; // characters

// Control characters, and those that reverse the direction of text.
const REFUSED = /[\p{Cc}\u200e\u200f\u2028-\u202e\u2066-\u2069]|\p{Surrogate}/gu;

/**
 * Return a name that the session accepts; empty if nothing of the text is left.
 *
 * @param {string} text
 */
export function cleanName(text) {
  const line = text.replace(REFUSED, " ").replace(/\s+/g, " ").trim();
  return [...line].slice(0, LONGEST).join("").trim();
}
