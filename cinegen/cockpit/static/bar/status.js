// The status of the robots in words. Of several, the worst is shown; during a drag that doesn't follow it stands at the hand, too,
// and no other label does.
//
// For tests: #status, data-status = the status's name (LOST without a connection), data-tone = good, warn, bad or none.

import { Quaternion, Vector3 } from "three";
import { atMostEvery, byId, write } from "../base/dom.js";
import { valueOf } from "../base/names.js";
import { announce } from "../base/speech.js";
import { StatusAnnouncer } from "./status_announcer.js";
import { statusesInWords } from "./status_words.js";

/** @type {Record<string, string>} */
const TONES = {
  FOLLOWING: "good",
  IDLE: "none",
  DETOUR: "good",
  BARRED: "warn",
  PUSHED: "warn",
  TOUCHING: "bad",
  IN_COLLISION: "bad",
  UNAVOIDABLE: "bad",
  AT_LIMIT: "warn",
  SINGULAR: "warn",
  UNCONTROLLED: "bad",
  DAMPED: "warn",
  OUT_OF_REACH: "warn",
  REFUSED: "bad",
  BAD_TARGET: "bad",
};
const NEAR = ["SINGULAR", "UNCONTROLLED"]; // a meter is red: this is always reported
const HAND = "hand"; // key of the label
const SEVERITY = ["none", "good", "warn", "bad"];
const LOST = { label: "connection lost", tone: "bad", name: "LOST", title: "The page shows the last state that it received" };
/** @type {Record<string, string>} */
const MOVING = { home: "moving home", move_to: "moving to a configuration", waypoint: "moving to a waypoint", undo: "undoing", redo: "redoing" };

export class Status {
  #where = new Vector3();

  /** @param {{ session: Session, view: View, labels: Labels }} parts */
  constructor({ session, view, labels }) {
    this.session = session;
    this.view = view;
    this.labels = labels;
    this.chip = byId("status");
    this.announcer = new StatusAnnouncer(announce);
    const show = atMostEvery(100, () => this.#show());
    for (const event of /** @type {const} */ (["state", "report", "lost", "dropped"])) session.on(event, () => show());
  }

  #show() {
    const { state, report, robots, obstacles, link } = this.session;
    const turn = this.view.cameraOrientation(new Quaternion());
    const axes = [0, 1, 2].map((i) => /** @type {[number, number, number]} */ (new Vector3().setComponent(i, 1).applyQuaternion(turn).toArray()));
    const words = statusesInWords(this.session, axes);
    const shown = link.connected ? summary(words, report, robots.length + obstacles.length > 1) : LOST;
    this.#atHand(words);
    if (shown === null) return;
    write(this.chip, shown.label);
    this.chip.dataset.tone = shown.tone;
    this.chip.dataset.status = shown.name;
    this.chip.title = shown.title;
    if (shown !== LOST) this.announcer.offer({ ...shown, driven: (state?.tasks ?? []).length > 0 }); // the cover tells that
  }

  /** @param {Record<string, { name?: string, label?: string }>} words by robot */
  #atHand(words) {
    const task = this.session.tasks.find(({ source }) => source === "pointer");
    const { name = "", label = "" } = (task && valueOf(words, task.robot)) ?? {};
    const shown = task !== undefined && ["warn", "bad"].includes(TONES[name] ?? "none");
    if (shown) this.#where.fromArray(task.target);
    this.labels.only = task === undefined ? null : HAND;
    this.labels.put(HAND, shown ? label : "", this.#where, "far");
  }
}

/**
 * Return the content of the chip; null if no status is known. The first of the robots with the worst status is shown,
 * unless the session is paused or moves by itself.
 * @param {Record<string, { name?: string, label?: string, description?: string }>} statuses by robot
 * @param {{ paused?: boolean, moving?: string | null } | null} report
 * @param {boolean} several there are several robots or obstacles: the robot is named
 */
export function summary(statuses, report, several) {
  const all = Object.entries(statuses).map(([robot, { name = "", label = "", description = "" } = {}]) => {
    return { robot, name, label, description, tone: TONES[name] ?? "none" };
  });
  if (all.length === 0) return null;
  const worst = all.reduce((worst, status) => (SEVERITY.indexOf(status.tone) > SEVERITY.indexOf(worst.tone) ? status : worst));
  let label = several && worst.tone !== "none" ? `${worst.robot}: ${worst.label}` : worst.label;
  let { tone } = worst;
  const session = report?.paused ? "paused" : MOVING[report?.moving ?? ""];
  if (session !== undefined) {
    if (NEAR.includes(worst.name)) label = `${session}, ${label}`;
    else [label, tone] = [session, report?.paused ? "none" : "good"];
  }
  const title = all.map((status) => `${status.robot}: ${status.label}${status.description ? ` (${status.description})` : ""}`).join("\n");
  return { label, tone, name: worst.name, title };
}
