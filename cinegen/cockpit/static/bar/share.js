// Links to the present view and configuration, in the fragment of the page's address.
//
// A page without a server places its robots as its address has them (cinegen/page/static/session/link.js). Here others
// may drive the same robots: a user is asked before they move.
//
// For tests: #copy-link.

import { byId } from "../base/dom.js";
import { cameraOf, configurationsOf, fragmentOf } from "../base/fragment.js";

const SAME = 1e-6; // rad or m: differences that no one sees

/** @typedef {import("../base/session.js").Session} Session */

export class Share {
  #met = false;

  /** @param {{ view: import("../view/view.js").View, session: Session }} parts */
  constructor({ view, session }) {
    this.view = view;
    this.session = session;
    byId("copy-link").addEventListener("click", () => this.copy());
    session.on("report", () => {
      if (!this.#met) this.#read();
      this.#met = true;
    });
    window.addEventListener("hashchange", () => {
      const { camera } = cameraOf(location.hash);
      if (camera !== null) view.setCamera(camera);
      this.#read();
    });
  }

  /** Copy a link to the clipboard, or put it into the address bar where the browser refuses that. */
  async copy() {
    const fragment = fragmentOf(this.session.configurations(), this.view.cameraNumbers());
    const url = new URL(fragment, location.href);
    const token = url.searchParams.has("token") ? " It contains the session's token: whoever has it can drive." : "";
    try {
      await navigator.clipboard.writeText(url.href);
      this.session.emit("notice", { text: `The link to this view and configuration is copied.${token}` });
    } catch {
      history.replaceState(null, "", fragment);
      this.session.emit("notice", { text: `The link is in the address bar: this browser does not copy it.${token}` });
    }
  }

  #read() {
    const { problem } = cameraOf(location.hash);
    if (problem) this.session.emit("notice", { text: problem, level: "warning" });
    if (this.session.link.owner === "session") this.#offer();
  }

  /** Offer to move the robots to the configuration in the address. */
  #offer() {
    const { session } = this;
    const sizes = new Map(session.robots.map(({ name, joints }) => [name, joints.length]));
    const { configurations, problem } = configurationsOf(location.hash, sizes);
    if (problem) session.emit("notice", { text: problem, level: "warning" });
    const present = new Map(session.configurations());
    const moved = [...configurations].filter(([name, q]) => q.some((value, i) => !(Math.abs(value - (present.get(name)?.[i] ?? NaN)) <= SAME)));
    if (moved.length === 0 || session.hello?.playback) return;
    const text = `The link has another configuration of ${moved.map(([name]) => name).join(", ")}.`;
    session.emit("notice", { text, action: { label: "Move there", run: () => moveTo(session, configurations) } });
  }
}

/**
 * Move the actuated joints of robots, as sliders do: within their limits, the passive joints follow.
 *
 * @param {Session} session
 * @param {Iterable<[string, ArrayLike<number>]>} configurations values of all joints, by robot
 */
export function moveTo(session, configurations) {
  if (!session.mayAct()) return;
  for (const [name, q] of configurations) {
    session.robot(name)?.joints.forEach(({ name: joint, actuated }, i) => {
      if (actuated) session.send({ type: "move_joint", robot: name, joint, value: q[i] });
    });
  }
  session.send({ type: "end_joint_motion" });
}
