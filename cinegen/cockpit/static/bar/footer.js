// The footer: who has control, the loop gap, and how fast things are.
//
// For tests: #gap, #rate, #delay, #pictures, #control.

import { byId, write } from "../base/dom.js";
import { valueOf } from "../base/names.js";
import { fixed, units } from "../base/units.js";

const CLOSED = 1e-9; // rad or characteristic lengths: smaller gaps are shown as 0
const SAME = 1e-5; // m: a target that came back

export class Footer {
  /** @type {[number, number[]][]} */
  #sent = []; // targets under way: [when, numbers]
  /** @type {number | null} */
  #delay = null; // ms

  /** @param {{ view: import("../view/view.js").View, session: import("../base/session.js").Session }} parts */
  constructor({ view, session }) {
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

  /**
   * A target was sent: the delay is the time until a state has it.
   *
   * @param {number[]} position
   */
  sent(position) {
    this.#sent.push([performance.now(), position]);
    if (this.#sent.length > 60) this.#sent.shift();
  }

  /** @param {import("../base/link.js").State} state */
  #answer(state) {
    if (this.#sent.length === 0) return;
    const target = state.tasks?.find((task) => task.source === "pointer")?.target;
    if (!target) return;
    const found = this.#sent.findIndex(([, position]) => [0, 1, 2].every((i) => Math.abs(position[i] - target[i]) < SAME));
    if (found < 0) return;
    const time = performance.now() - this.#sent[found][0];
    this.#sent.splice(0, found + 1);
    this.#delay = this.#delay === null ? time : 0.8 * this.#delay + 0.2 * time;
  }

  /** @param {import("../base/link.js").Report} report */
  #show({ robots = {}, rate, clients, compilation }) {
    const gaps = this.session.robots.map((robot) => [valueOf(robots, robot.name)?.closure ?? 0, robot.length]);
    const [gap, length] = gaps.reduce((one, other) => (other[0] > one[0] ? other : one), [0, 1]);
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
    const others = clients > 1 ? ` · ${clients} browsers` : "";
    const labels = { mine: "you have control", other: "another browser has control", free: "no browser has control" };
    const { viewOnly, control } = this.session;
    write(byId("control"), `${viewOnly ? "view only" : labels[control]}${others}`);
  }
}

/**
 * Return the text of the solver's rate, whether deadlines were missed in the last second, and the hint.
 *
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
