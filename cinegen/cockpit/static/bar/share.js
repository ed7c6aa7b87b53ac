// Links to the present view and configuration, in the fragment of the page's address.
//
// A page without a server places its robots as its address has them (cinegen/page/static/session/link.js). Here others
// may drive the same robots: a user is asked before they move.
//
// For tests: #section-share with #picture, #film-video, #copy-link, #copy-view-link and #page-copy.

import { pageUrl } from "../base/address.js";
import { button, make } from "../base/dom.js";
import { download } from "../base/download.js";
import { Section } from "../panel/section.js";
import { cameraOf, configurationsOf, fragmentOf } from "../base/fragment.js";

const SAME = 1e-6; // rad or m: differences that no one sees

export class Share {
  #met = false;

  /** @param {HTMLElement} panel @param {{ view: View, session: Session }} parts */
  constructor(panel, { view, session }) {
    const { body } = new Section(panel, "share", "Share", "Links, pictures and films of what the view shows");
    const press = (/** @type {string} */ id, /** @type {string} */ title, /** @type {string} */ text, click = () => {}) =>
      button({ id, class: "small", title }, click, text);
    const viewers = press("copy-view-link", "Copy the same link for people who only view", "View-only link", () =>
      this.copy(`?view=${session.hello?.view_token}`));
    session.on("hello", ({ view_token: token }) => (viewers.hidden = !token));
    body.append(
      press("copy-link", "Copy a link to this page with the present view and configuration", "Copy link", () => this.copy("")),
      viewers,
      press("picture", "Download what the view shows as a PNG", "Picture", () => this.picture()),
      press("film-video", "Record what the view shows, at most 60 s, and download it", "Film"),
      make("a", { id: "page-copy", class: "button small", href: location.search ? pageUrl("snapshot.html") : "snapshot.html", download: "", title: "Download the scene as it is now: one HTML file to look at" }, "Snapshot"),
    );
    body.classList.add("grid");
    this.view = view;
    this.session = session;
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

  picture() {
    download(this.view.picture(), `${this.session.hello?.title ?? "cinegen"}.png`);
  }

  /**
   * Copy a link to the clipboard, or show it where the browser refuses that.
   * @param {string} query of its address; empty: as the page's
   */
  async copy(query) {
    const fragment = fragmentOf(this.session.configurations(), this.view.cameraNumbers());
    const url = new URL(query + fragment, location.href);
    const { searchParams: has } = url;
    const token = has.has("token") ? " It contains the session's token: whoever has it can drive." : has.has("view") ? " Whoever has it can only view." : "";
    const copied = await navigator.clipboard?.writeText(url.href).then(() => true, () => false);
    this.session.emit("notice", { text: `${copied ? "The link to this view and configuration is copied." : `Copy this link: ${url.href}.`}${token}` });
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
