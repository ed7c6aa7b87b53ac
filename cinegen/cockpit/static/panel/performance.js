// How fast and exact things are, for those who look for it. `?debug=1` in the page's address opens it.
//
// For tests: #section-performance; #gap, #rate, #delay, #pictures.

import { byId, make, write } from "../base/dom.js";
import { valueOf } from "../base/names.js";
import { fixed, units } from "../base/units.js";
import { Section } from "./section.js";

const CLOSED = 1e-9; // rad or characteristic lengths: smaller gaps are shown as 0
const SAME = 1e-5; // m: a target that came back
const READINGS = [
  ["gap", "Loop gap", "Largest loop residual. Loops are closed in every tick, so it stays at zero"],
  ["rate", "Solver", "Ticks of the solver in the last second, and deadlines that it missed"],
  ["delay", "Delay", "Time from a motion of the pointer to the robot's answer, during a drag"],
  ["pictures", "Frame", "Time from one frame to the next while something moves"],
];

export class Performance {
  /** @type {[number, number[]][]} */
  #sent = []; // targets under way: [when, numbers]
  /** @type {number | null} */
  #delay = null; // ms

  /** @param {HTMLElement} panel @param {{ view: View, session: Session, open: boolean }} parts */
  constructor(panel, { view, session, open }) {
    const section = new Section(panel, "performance", "Performance", "Loop gap, rate of the solver, delay and time per frame", false);
    section.element.open ||= open;
    for (const [id, name, title] of READINGS) {
      const output = make("output", { id, class: "number", "aria-live": "off", "aria-label": name }, "–");
      section.body.append(make("div", { class: "pair", title }, make("span", { class: "quiet" }, name), output));
    }
    this.view = view;
    this.session = session;
    session.on("state", (state) => this.#answer(state));
    session.on("report", (report) => this.#show(report));
    for (const name of /** @type {const} */ (["lost", "dropped"])) {
      session.on(name, () => {
        this.#sent.length = 0;
      });
    }
  }

  /** A target was sent: the delay is the time until a state has it. @param {number[]} position */
  sent(position) {
    this.#sent.push([performance.now(), position]);
    if (this.#sent.length > 60) this.#sent.shift();
  }

  /** @param {State} state */
  #answer(state) {
    if (this.#sent.length === 0) return;
    const target = state.tasks?.find((task) => task.source === "pointer")?.target;
    if (!target) return;
    const answered = this.#sent.findIndex(([, position]) => [0, 1, 2].every((i) => Math.abs(position[i] - target[i]) < SAME));
    if (answered < 0) return;
    const time = performance.now() - this.#sent[answered][0];
    this.#sent.splice(0, answered + 1);
    this.#delay = this.#delay === null ? time : 0.8 * this.#delay + 0.2 * time;
  }

  /** @param {SessionReport} report */
  #show({ robots = {}, rate, compilation }) {
    const gaps = this.session.robots.map((robot) => [valueOf(robots, robot.name)?.closure ?? 0, robot.length]);
    const [gap, length] = gaps.reduce((widest, other) => (other[0] > widest[0] ? other : widest), [0, 1]);
    const none = !this.session.robots.some((robot) => robot.loops.length + robot.couplings.length > 0);
    write(
      byId("gap"),
      none ? "no loops" : gap < CLOSED ? units.length(0) : `${units.length(gap * length)} (${gap.toExponential(0)})`,
    );
    byId("gap").classList.toggle("bad", gap >= CLOSED);
    const interpreted = typeof compilation === "number" ? ` in Python, compiling ${Math.round(100 * compilation)} %` : "";
    const { text, late, title } = ticking(rate);
    write(byId("rate"), `${text}${interpreted}`);
    byId("rate").classList.toggle("bad", interpreted !== "" || late);
    byId("rate").title = title;
    write(byId("delay"), this.#delay === null ? "–" : `${fixed(this.#delay, 0)} ms`);
    write(byId("pictures"), this.view.resolution.mean === null ? "–" : `${fixed(this.view.resolution.mean, 0)} ms`);
  }
}

/**
 * Return the text of the solver's rate, whether deadlines were missed in the last second, and the hint.
 * @param {import("../base/messages").TickRate | undefined} rate
 */
export function ticking(rate) {
  if (rate === undefined || rate === null) return { text: "–", late: false, title: "" };
  const { ticks, missed, missed_in_all: all, late, at_rest: resting } = rate;
  const missing = missed > 0 ? `, ${missed} missed` : "";
  return {
    text: resting && missed === 0 ? "at rest" : `${Math.round(ticks)} /s${missing}`,
    late: missed > 0,
    title:
      `In the last second: ${Math.round(ticks)} ticks, ${missed} missed. Since the start: ${all} missed` +
      (Number.isFinite(late) ? `, 99 % begin ${fixed(late, 2)} ms late at most` : ""),
  };
}
