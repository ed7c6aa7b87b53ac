// The configuration of robots and the camera in the fragment of the page's address: `#delta4=0.1,-0.2,...&arm=...`, all
// values of q in rad and m, and `@camera=x,y,z,x,y,z`, its position and the point in its middle, in the world, m. A link
// is foreign text: what it holds is checked before anything moves.

const MOST = 20000; // characters
const FURTHEST = 1e6; // rad or m
const CAMERA = "@camera"; // no robot's name in a fragment: "@" would be "%40" in it
const DIGITS = 6; // of the camera's numbers
const NEAREST = 1e-9; // of the distance of the camera's position from the origin, and m: it must look somewhere

/** @typedef {[number, number, number, number, number, number]} Camera its position, and the point in its middle, m */

/**
 * Return the fragment of configurations and a camera.
 * @param {Iterable<[string, ArrayLike<number>]>} configurations by robot
 * @param {Camera | null} camera
 */
export function fragmentOf(configurations, camera = null) {
  const parts = [...configurations].map(([name, q]) => `${encodeURIComponent(name)}=${Array.from(q).join(",")}`);
  if (camera !== null) parts.push(`${CAMERA}=${camera.map((value) => Number(value.toPrecision(DIGITS))).join(",")}`);
  return `#${parts.join("&")}`;
}

/**
 * Return the camera in a fragment.
 * @param {string} fragment
 * @returns {{ camera: Camera | null, problem: string }} `problem`: why it is ignored
 */
export function cameraOf(fragment) {
  const text = fragment.replace(/^#/, "");
  const part = text.length > MOST ? undefined : text.split("&").find((one) => one.split("=", 1)[0] === CAMERA);
  if (part === undefined) return { camera: null, problem: "" };
  const camera = numbersOf(part.slice(CAMERA.length + 1));
  const [x, y, z, ...middle] = camera;
  const away = Math.hypot(x - middle[0], y - middle[1], z - middle[2]);
  const seen = camera.length === 6 && camera.every((value) => Math.abs(value) <= FURTHEST) && away > NEAREST * (1 + Math.hypot(x, y, z));
  if (!seen) return { camera: null, problem: "the link gives no camera: its position and another point are needed, six numbers in m" };
  return { camera: /** @type {Camera} */ (camera), problem: "" };
}

/** @param {string} text */
function numbersOf(text) {
  return text.split(",").map((value) => (value.trim() === "" ? NaN : Number(value)));
}

/**
 * Return the configurations in a fragment, by robot.
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
    if (key === CAMERA) continue;
    const name = decoded(key);
    const size = sizes.get(name);
    if (size === undefined) return { configurations: new Map(), problem: `the link names a robot '${name}' that is not here` };
    const q = Float64Array.from(numbersOf(values));
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
