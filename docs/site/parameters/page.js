// The page with six sliders: it draws the frames again whenever one of them moves, or the view.

import { transform } from "./frames.js";
import { picture, shown } from "./picture.js";

/** @typedef {import("./frames.js").Parameters} Parameters */

const NAMES = /** @type {(keyof Parameters)[]} */ (["gamma", "epsilon", "alpha", "d", "theta", "r"]);
const TURN = 5, LOWEST = 0, HIGHEST = 85; // degrees: of a key, and the eye's elevation
const START = { azimuth: -22, elevation: 24 };

/** @param {string} id */
const byId = (id) => /** @type {HTMLElement} */ (document.getElementById(id));
/** @param {string} name */
const slider = (name) => /** @type {HTMLInputElement} */ (byId(name));
const view = { ...START };

/** @returns {Parameters} */
function values() {
  const values = NAMES.map((name) => [name, Number(slider(name).value)]);
  return /** @type {Parameters} */ (Object.fromEntries(values));
}

function draw() {
  const p = values(), svg = byId("picture");
  svg.innerHTML = picture(p, view).svg;
  svg.dataset.azimuth = String(view.azimuth);
  svg.dataset.elevation = String(view.elevation);
  for (const name of NAMES) {
    const unit = slider(name).dataset.unit ?? "";
    slider(name).setAttribute("aria-valuetext", `${p[name]} ${unit === "°" ? "degrees" : "millimetres"}`);
    byId(`${name}-value`).textContent = `${shown(p[name])} ${unit}`.replace(" °", "°");
  }
  for (const [k, row] of transform(p).entries()) {
    for (const [column, value] of row.entries()) byId(`t${k}${column}`).textContent = cell(value, k, column);
  }
  const written = NAMES.filter((name) => p[name]).map((name) => `${name} ${p[name]}`);
  byId("raff").textContent = `link 1 { parameters { ${written.join(" ")} } type 2 pred 0 }`;
}

/** A number of the matrix: lengths in mm with two decimals, all others with four.
 * @param {number} value @param {number} row @param {number} column */
function cell(value, row, column) {
  const text = row === 3 ? String(value) : value.toFixed(column === 3 ? 2 : 4);
  return text.replace(/^-(?=0(\.0*)?$)/, "").replace("-", "−");
}

/** @param {number} right @param {number} up degrees */
function look(right, up) {
  view.azimuth -= right;
  view.elevation = Math.min(Math.max(view.elevation + up, LOWEST), HIGHEST);
  draw();
}

function start() {
  for (const name of NAMES) slider(name).addEventListener("input", draw);
  byId("reset").addEventListener("click", () => {
    for (const name of NAMES) slider(name).value = slider(name).defaultValue;
    Object.assign(view, START);
    draw();
  });
  const svg = byId("picture");
  svg.addEventListener("keydown", (event) => {
    const turns = { ArrowLeft: [-TURN, 0], ArrowRight: [TURN, 0], ArrowUp: [0, TURN], ArrowDown: [0, -TURN] };
    const turn = turns[/** @type {keyof typeof turns} */ (event.key)];
    if (!turn) return;
    event.preventDefault();
    look(turn[0], turn[1]);
  });
  svg.addEventListener("pointerdown", (event) => svg.setPointerCapture(event.pointerId));
  svg.addEventListener("pointermove", (event) => {
    if (svg.hasPointerCapture(event.pointerId)) look(0.4 * event.movementX, 0.4 * event.movementY);
  });
  draw();
  byId("live").hidden = false;
}

start();
