// Which of the aids are shown; chosen on the tab View and remembered.

import { memory } from "../base/dom.js";
import { Events } from "../base/events.js";

export const AIDS = [
  { id: "ghost", label: "Targets of tasks", hint: "A translucent copy of the part at its target, and a line to it" },
  {
    id: "singular",
    label: "Lost and uncontrolled DoF",
    hint: "Arrow or arc of a motion that is lost or uncontrolled, near singularities",
  },
  { id: "forecast", label: "Forecast", hint: "Path of the task, with the singularities and limits on it" },
  { id: "limits", label: "Limits", hint: "While a robot is moved, the range of each joint near a limit: an arc or a rail" },
  { id: "trail", label: "Trail", hint: "Past positions of the driven part, or of the tool" },
  { id: "ellipsoid", label: "Manipulability ellipsoid", hint: "Long where the tool moves easily, flat where hardly" },
  { id: "reactions", label: "Reactions", hint: "Forces of joints and loops on the parts behind them, at rest" },
  { id: "frames", label: "Frames", hint: "Axes of the tool: red x, green y, blue z" },
  { id: "loops", label: "Loop marks", hint: "Balls where loops are closed; those of an open loop are always shown" },
];
const OFF = ["ellipsoid", "reactions", "loops"]; // until they are chosen
export const BODIES = ["parts", "skeleton"];

/**
 * Events: change.
 * @extends {Events<{ change: undefined }>}
 */
export class Aids extends Events {
  /** @type {Map<string, boolean>} */
  #on;
  bodies = memory.get("bodies", "parts"); // how robots are drawn

  /** @param {boolean} none show none, whatever was chosen */
  constructor(none = false) {
    super();
    this.none = none;
    const chosen = memory.get("aids", /** @type {Record<string, boolean>} */ ({}));
    this.#on = new Map(AIDS.map(({ id }) => [id, chosen[id] ?? !OFF.includes(id)]));
    if (!BODIES.includes(this.bodies)) this.bodies = "parts";
  }

  /** @param {string} id */
  shows(id) {
    return !this.none && this.#on.get(id) === true;
  }

  /** @param {string} id @param {boolean} on */
  choose(id, on) {
    this.#on.set(id, on);
    memory.set("aids", Object.fromEntries(this.#on));
    this.emit("change");
  }

  /** @param {string} bodies */
  draw(bodies) {
    this.bodies = bodies;
    memory.set("bodies", bodies);
    this.emit("change");
  }
}
