// The four frames as SVG in parallel projection: axes, the steps between them, and their dimensions.

import { cross, dot, frames, plus, rotated } from "./frames.js";

/** @typedef {import("./frames.js").Vector} Vector */
/** @typedef {import("./frames.js").Parameters} Parameters */
/** @typedef {import("./frames.js").Frame} Frame */
/** @typedef {{ azimuth: number, elevation: number }} View direction of the eye, degrees */
/** @typedef {[number, number]} Pixel */

export const WIDE = 720, TALL = 460;
export const STEPS = ["#007a59", "#b35900", "#0072b2"]; // colours of the steps to F1, F2 and F3
const AXES = ["#d55e00", "#009e73", "#0072b2"], INK = "#2b3036", GRID = "#dde1e6", FAINT = "#6b7178";
const AXIS = 70, ARC = 46, HALF = 200, GRID_STEP = 50; // mm
const MARGIN = 46, SCALE = 1.05; // pixels, pixels for a mm at most
const SMALL = 1e-9;

/** A drawing of the frames.
 * @param {Parameters} p @param {View} view
 * @returns {{ svg: string, project: (point: Vector) => Pixel }} elements of SVG, and pixels of points in mm */
export function picture(p, view) {
  const all = frames(p), project = projection(all, view);
  const parts = [ground(project), ...steps(all, p, project), axisOfJoint(all[3], project)];
  for (const [k, frame] of all.entries()) {
    const moved = k === 0 || !same(frame, all[k - 1]);
    if (moved) parts.push(triad(frame, k, project));
  }
  parts.push(...angles(all, p, project));
  return { svg: parts.join(""), project };
}

/** Right, up and towards the eye.
 * @param {View} view @returns {[Vector, Vector, Vector]} */
function axesOf(view) {
  const a = (view.azimuth * Math.PI) / 180, e = (view.elevation * Math.PI) / 180;
  /** @type {Vector} */
  const eye = [Math.cos(a) * Math.cos(e), Math.sin(a) * Math.cos(e), Math.sin(e)];
  /** @type {Vector} */
  const right = [-Math.sin(a), Math.cos(a), 0];
  return [right, cross(eye, right), eye];
}

/** The projection in which the frames fit into the picture; no larger than SCALE.
 * @param {Frame[]} all @param {View} view @returns {(point: Vector) => Pixel} */
function projection(all, view) {
  const [right, up] = axesOf(view);
  const points = all.flatMap((f) => [f.origin, ...[f.x, f.y, f.z].map((axis) => plus(f.origin, axis, AXIS))]);
  const flat = points.map((point) => [dot(point, right), dot(point, up)]);
  const low = [0, 1].map((k) => Math.min(...flat.map((point) => point[k])));
  const high = [0, 1].map((k) => Math.max(...flat.map((point) => point[k])));
  const fit = [(WIDE - 2 * MARGIN) / (high[0] - low[0]), (TALL - 2 * MARGIN) / (high[1] - low[1])];
  const scale = Math.min(SCALE, ...fit);
  return (point) => [
    WIDE / 2 + scale * (dot(point, right) - (low[0] + high[0]) / 2),
    TALL / 2 - scale * (dot(point, up) - (low[1] + high[1]) / 2),
  ];
}

/** @param {(point: Vector) => Pixel} project */
function ground(project) {
  const lines = [];
  for (let k = -HALF; k <= HALF; k += GRID_STEP) {
    lines.push(path([[k, -HALF, 0], [k, HALF, 0]], project), path([[-HALF, k, 0], [HALF, k, 0]], project));
  }
  const corners = /** @type {Vector[]} */ ([[-HALF, -HALF, 0], [HALF, -HALF, 0], [HALF, HALF, 0], [-HALF, HALF, 0]]);
  return `<path d="${path(corners, project)}Z" fill="#f1f3f5"/><path d="${lines.join("")}" stroke="${GRID}" fill="none"/>`;
}

/** The three lengths as bars with their dimensions.
 * @param {Frame[]} all @param {Parameters} p @param {(point: Vector) => Pixel} project */
function steps(all, p, project) {
  const named = /** @type {[string, number][]} */ ([["ε", p.epsilon], ["d", p.d], ["r", p.r]]);
  const pixels = all.map((frame) => project(frame.origin));
  const middle = /** @type {Pixel} */ ([0, 1].map((k) => pixels.reduce((sum, pixel) => sum + pixel[k] / 4, 0)));
  return named.map(([name, value], k) => {
    if (Math.abs(value) < SMALL) return "";
    const ends = [all[k].origin, all[k + 1].origin], [from, to] = ends.map(project);
    const bar = [[12, "#fff"], [9, STEPS[k]]].map(([width, colour]) => stroke(path(ends, project), `${colour}`, Number(width)));
    return bar.join("") + dimension(from, to, middle, `${name} = ${shown(value)}`, STEPS[k]);
  });
}

/** A length between two pixels, beside them.
 * @param {Pixel} from @param {Pixel} to @param {Pixel} middle of the picture @param {string} words @param {string} colour */
function dimension(from, to, middle, words, colour) {
  const way = side(from, to, middle), [a, b] = [from, to].map((end) => /** @type {Pixel} */ ([end[0] + 18 * way[0], end[1] + 18 * way[1]]));
  const ends = [from, to].map((end) => `M${pair(end)}l${(22 * way[0]).toFixed(1)} ${(22 * way[1]).toFixed(1)}`);
  const lines = stroke(ends.join(""), FAINT, 1) + stroke(`M${pair(a)}L${pair(b)}`, colour, 1.4) + head(a, b, colour) + head(b, a, colour);
  return lines + text(between(a, b), way, words, colour, "b");
}

/** The three angles, each with both of its sides.
 * @param {Frame[]} all @param {Parameters} p @param {(point: Vector) => Pixel} project */
function angles(all, p, project) {
  const [f0, f1, f2, f3] = all;
  return [
    arc(f0.origin, f0.z, f0.x, p.gamma, ARC * 1.3, `γ = ${shown(p.gamma)}°`, STEPS[0], project),
    arc(f2.origin, f1.x, f1.z, p.alpha, ARC * 1.15, `α = ${shown(p.alpha)}°`, STEPS[1], project),
    arc(f3.origin, f2.z, f2.x, p.theta, ARC, `θ = ${shown(p.theta)}°`, STEPS[2], project),
  ];
}

/** @param {Vector} centre @param {Vector} axis @param {Vector} begin @param {number} angle @param {number} radius
 * @param {string} words @param {string} colour @param {(point: Vector) => Pixel} project */
function arc(centre, axis, begin, angle, radius, words, colour, project) {
  if (Math.abs(angle) < SMALL) return "";
  const count = Math.max(2, Math.ceil(Math.abs(angle) / 4));
  const at = (/** @type {number} */ part) => plus(centre, rotated(begin, axis, angle * part), radius);
  const points = Array.from({ length: count + 1 }, (_, k) => at(k / count));
  const sides = [begin, rotated(begin, axis, angle)].map((way) => path([centre, plus(centre, way, 1.3 * radius)], project));
  const middle = project(at(0.5)), from = project(centre);
  return (
    `<path d="${path([centre, ...points], project)}Z" fill="${colour}" opacity="0.12"/>` +
    stroke(sides.join(""), FAINT, 1.2, "2 4") + stroke(path(points, project), colour, 2) +
    head(project(points[count]), project(points[count - 1]), colour) +
    text(middle, unit([middle[0] - from[0], middle[1] - from[1]]), words, colour, "b")
  );
}

/** @param {Frame} frame @param {(point: Vector) => Pixel} project */
function axisOfJoint(frame, project) {
  const ends = [plus(frame.origin, frame.z, -130), plus(frame.origin, frame.z, 130)];
  return stroke(path(ends, project), AXES[0], 1.3, "12 4 2 4");
}

/** @param {Frame} frame @param {number} number @param {(point: Vector) => Pixel} project */
function triad(frame, number, project) {
  const strong = number === 0 || number === 3, origin = project(frame.origin), parts = [];
  for (const [k, way] of [frame.x, frame.y, frame.z].entries()) {
    const end = project(plus(frame.origin, way, strong ? AXIS : 0.6 * AXIS));
    const towards = unit([end[0] - origin[0], end[1] - origin[1]]);
    parts.push(stroke(`M${pair(origin)}L${pair(end)}`, AXES[k], strong ? 2.4 : 1.6), head(end, origin, AXES[k]));
    if (strong) parts.push(text(end, towards, `${"xyz"[k]}${number}`, AXES[k], "i"));
  }
  const [x, y] = origin;
  const dotted = `<circle data-frame="F${number}" cx="${x.toFixed(2)}" cy="${y.toFixed(2)}" r="4.5" fill="${INK}"/>`;
  return parts.join("") + dotted + text(origin, [-0.7, 0.7], `F${number}`, INK, "");
}

/** @param {Frame} before @param {Frame} after */
function same(before, after) {
  const gap = (/** @type {Vector} */ a, /** @type {Vector} */ b) => Math.hypot(...plus(a, b, -1));
  return gap(before.origin, after.origin) < 1e-6 && gap(before.x, after.x) < 1e-6 && gap(before.z, after.z) < 1e-6;
}

/** @param {number} value */
export function shown(value) {
  return String(Math.round(1000 * value) / 1000).replace("-", "−");
}

/** @param {Pixel} pixel */
function pair(pixel) {
  return `${pixel[0].toFixed(1)} ${pixel[1].toFixed(1)}`;
}

/** @param {Vector[]} points @param {(point: Vector) => Pixel} project */
function path(points, project) {
  return "M" + points.map((point) => pair(project(point))).join("L");
}

/** @param {string} d @param {string} colour @param {number} width @param {string} [dash] */
function stroke(d, colour, width, dash = "") {
  const dashes = dash && ` stroke-dasharray="${dash}"`;
  return `<path d="${d}" fill="none" stroke="${colour}" stroke-width="${width}" stroke-linecap="round"${dashes}/>`;
}

/** @param {Pixel} tip @param {Pixel} before @param {string} colour */
function head(tip, before, colour) {
  const [x, y] = unit([before[0] - tip[0], before[1] - tip[1]]);
  const foot = [tip[0] + 10 * x, tip[1] + 10 * y];
  const corners = [[foot[0] - 4 * y, foot[1] + 4 * x], [foot[0] + 4 * y, foot[1] - 4 * x]];
  return `<path d="M${pair(tip)}${corners.map((one) => `L${one[0].toFixed(1)} ${one[1].toFixed(1)}`).join("")}Z" fill="${colour}"/>`;
}

/** A text whose middle lies beside a pixel, in a direction.
 * @param {Pixel} at @param {Pixel} towards @param {string} words @param {string} colour @param {string} style */
function text(at, towards, words, colour, style) {
  const wide = 4.3 * words.length + 7, tall = 15;
  const reach = Math.min(wide / Math.max(Math.abs(towards[0]), SMALL), tall / Math.max(Math.abs(towards[1]), SMALL));
  const x = Math.min(Math.max(at[0] + reach * towards[0], wide), WIDE - wide);
  const y = Math.min(Math.max(at[1] + reach * towards[1], tall), TALL - tall);
  return `<text x="${x.toFixed(1)}" y="${(y + 5).toFixed(1)}" fill="${colour}" class="${style}">${words}</text>`;
}

/** @param {Pixel} a @param {Pixel} b @returns {Pixel} */
function between(a, b) {
  return [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
}

/** The direction at right angles to a line, away from the middle.
 * @param {Pixel} a @param {Pixel} b @param {Pixel} middle @returns {Pixel} */
function side(a, b, middle) {
  const [x, y] = unit([b[0] - a[0], b[1] - a[1]]), mark = between(a, b);
  const isAway = -y * (mark[0] - middle[0]) + x * (mark[1] - middle[1]) >= 0;
  return isAway ? [-y, x] : [y, -x];
}

/** @param {Pixel} way @returns {Pixel} */
function unit(way) {
  const length = Math.hypot(...way);
  return length < SMALL ? [0, -1] : [way[0] / length, way[1] / length];
}
