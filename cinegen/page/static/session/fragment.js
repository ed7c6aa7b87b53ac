// The configuration of robots in the fragment of the page's address: `#delta4=0.1,-0.2,...&arm=...`, all values of q
// in rad and m. A link is foreign text: what it holds is checked before any robot moves.

const MOST = 20000; // characters
const FURTHEST = 1e6; // rad or m

/**
 * Return the fragment of configurations.
 *
 * @param {Iterable<[string, Float64Array]>} configurations by robot
 */
export function fragmentOf(configurations) {
  return `#${[...configurations].map(([name, q]) => `${encodeURIComponent(name)}=${q.join(",")}`).join("&")}`;
}

/**
 * Return the configurations in a fragment, by robot.
 *
 * @param {string} fragment
 * @param {Map<string, number>} sizes number of values of each robot's configuration
 * @returns {{ configurations: Map<string, Float64Array>, problem: string }} `problem`: why it, or a part of it, is ignored
 */
export function configurationsOf(fragment, sizes) {
  /** @type {Map<string, Float64Array>} */
  const configurations = new Map();
  const text = fragment.replace(/^#/, "");
  if (text === "") return { configurations, problem: "" };
  if (text.length > MOST) return { configurations, problem: "the link's fragment is too long" };
  for (const part of text.split("&")) {
    const [key, values = ""] = part.split("=", 2);
    const name = decoded(key);
    const size = sizes.get(name);
    if (size === undefined) return { configurations: new Map(), problem: `the link names a robot '${name}' that is not here` };
    const q = Float64Array.from(values.split(","), (value) => (value.trim() === "" ? NaN : Number(value)));
    if (q.length !== size || !q.every((value) => Math.abs(value) <= FURTHEST)) {
      return { configurations: new Map(), problem: `the link gives no configuration of ${name}: ${size} numbers are needed` };
    }
    configurations.set(name, q);
  }
  return { configurations, problem: "" };
}

/** @param {string} text */
function decoded(text) {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}
