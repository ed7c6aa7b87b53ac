// Singularity: how near the robot is to losing a motion (type 1) and to one that its actuated joints don't control
// (type 2), each on a log scale with the mark below which it is near, and as a text.
//
// For tests: [data-meter="ROBOT/type1"], [data-meter="ROBOT/type2"]; role meter with aria-valuenow = sigma.

import { make, write } from "../base/dom.js";
import { valueOf } from "../base/names.js";
import { speak } from "../base/speech.js";
import { significant } from "../base/units.js";
import { byRobot, Section } from "./section.js";

const LEAST = 1e-3;
const MOST = 1;
const AWARE = 3; // times the threshold: the meter turns orange

/** @typedef {import("../base/messages").SingularityReport} Singular */
/**
 * @typedef {{ none: string, meter: HTMLElement, value: HTMLElement, bar: HTMLElement, mark: HTMLElement, label: HTMLElement }} Row
 */

/** @type {{ kind: "type1" | "type2", title: string, none: string, hint: string }[]} */
const KINDS = [
  {
    kind: "type1",
    title: "Lost DoF",
    none: "drag a part to see it",
    hint: "Type 1: near 0 the part can't move along some direction, however the joints move. Full and green is good.",
  },
  {
    kind: "type2",
    title: "Uncontrolled DoF",
    none: "no loops or couplings: can't happen",
    hint: "Type 2: near 0 the robot can move while its actuated joints are locked. Full and green is good.",
  },
];

export class Singularity {
  /** @type {Map<string, Row>} */
  #meters = new Map();

  /** @param {HTMLElement} panel @param {Session} session */
  constructor(panel, session) {
    this.session = session;
    this.section = new Section(panel, "singularity", "Singularity", "How far the robot is from configurations with a lost or an uncontrolled DoF");
    session.on("hello", () => this.#build());
    session.on("report", () => this.#show());
  }

  #build() {
    this.#meters.clear();
    byRobot(this.section.body, this.session.robots, (robot, body) => {
      for (const { kind, title, none, hint } of KINDS) {
        const value = make("output", { class: "number quiet", "aria-live": "off" });
        const bar = make("b");
        const mark = make("i", { title: "Below this mark it is near a singularity" });
        const label = make("div", { class: "description" });
        const key = `${robot.name}/${kind}`;
        const scale = make("div", { class: "scale" }, bar, mark);
        const meter = make(
          "div",
          {
            class: "meter",
            data: { meter: key },
            role: "meter",
            title: hint,
            tabindex: 0,
            "aria-label": `${title}, ${robot.name}`,
            "aria-valuemin": 0,
            "aria-valuemax": MOST,
            "aria-valuenow": 0,
            "aria-valuetext": "not known yet",
          },
          make("div", { class: "head" }, make("span", {}, title), value),
          scale,
          label,
        );
        this.#meters.set(key, { none, meter, value, bar, mark, label });
        body.append(meter);
      }
    });
  }

  #show() {
    for (const robot of this.session.robots) {
      for (const { kind } of KINDS) {
        const drawn = this.#meters.get(`${robot.name}/${kind}`);
        const singularity = valueOf(this.session.report?.robots, robot.name)?.[kind];
        const sigma = singularity?.sigma ?? NaN;
        const near = singularity?.threshold ?? 0;
        const known = Number.isFinite(sigma);
        if (drawn === undefined) continue;
        const none = kind === "type2" && robot.loops.length + robot.couplings.length > 0 ? "not known" : drawn.none;
        drawn.bar.style.transform = `scaleX(${known ? share(sigma) : 0})`;
        drawn.mark.hidden = !known || !(near > 0);
        if (!drawn.mark.hidden) drawn.mark.style.left = `${(100 * share(near)).toFixed(1)}%`;
        drawn.meter.dataset.tone = !known ? "none" : tone(sigma, near);
        drawn.meter.setAttribute("aria-valuenow", known ? String(sigma) : "0");
        const text = known ? (singularity?.text ?? "") : none;
        speak(drawn.meter, known ? `${significant(sigma)}, ${text}` : text);
        write(drawn.value, known ? significant(sigma) : "–");
        write(drawn.label, text);
        if (drawn.label.title !== text) drawn.label.title = text;
      }
    }
  }
}

/** Return the filled share of the scale, 0 to 1, of a singular value. @param {number} sigma */
export function share(sigma) {
  const decades = Math.log(MOST / LEAST);
  return Math.min(1, Math.max(0, Math.log(Math.max(sigma, LEAST) / LEAST) / decades));
}

/**
 * Return the colour of a meter: bad below the threshold, warn near it.
 * @param {number} sigma
 * @param {number} near the threshold; 0 where there is none
 */
export function tone(sigma, near) {
  if (!(near > 0)) return "good";
  return sigma < near ? "bad" : sigma < AWARE * near ? "warn" : "good";
}
