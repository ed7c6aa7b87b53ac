// The status: what the robot does, in a few words. Of several robots the one that is in most trouble speaks.
//
// For tests: #status, data-status = the status's name, data-tone = good, warn, bad or none.

import { atMostEvery, byId, write } from "../base/dom.js";

/** @type {Record<string, string>} */
const TONES = {
  FOLLOWING: "good",
  IDLE: "none",
  DETOUR: "good",
  BARRED: "warn",
  PUSHED: "warn",
  TOUCHING: "bad",
  AT_LIMIT: "warn",
  SINGULAR: "warn",
  OUT_OF_REACH: "warn",
  REFUSED: "bad",
  BAD_TARGET: "bad",
};
const TROUBLE = ["none", "good", "warn", "bad"];
const IDLE = "ready";
/** @type {Record<string, string>} */
const MOVING = { home: "going home", visit: "going there", undo: "going back", redo: "going on" };

export class Status {
  /** @param {import("../base/session.js").Session} session */
  constructor(session) {
    this.session = session;
    this.chip = byId("status");
    const show = atMostEvery(100, () => this.#show());
    session.on("state", () => show());
    session.on("report", () => show());
  }

  #show() {
    const { state, report, robots, obstacles } = this.session;
    const shown = summary(state?.statuses ?? {}, report, robots.length + obstacles.length > 1);
    if (shown === null) return;
    write(this.chip, shown.words);
    this.chip.dataset.tone = shown.tone;
    this.chip.dataset.status = shown.name;
    this.chip.title = shown.title;
  }
}

/**
 * Return what the chip shows of the status of all robots; null where none is known. The first robot in most trouble
 * is shown, unless the session is paused or moves by itself.
 *
 * @param {Record<string, { name?: string, words?: string }>} statuses by robot
 * @param {{ paused?: boolean, moving?: string | null } | null} report
 * @param {boolean} several there are several robots or obstacles: the robot is named
 */
export function summary(statuses, report, several) {
  const told = Object.entries(statuses).map(([robot, { name = "", words } = {}]) => {
    const text = name === "IDLE" ? IDLE : (words ?? name);
    return { robot, name, words: text, tone: TONES[name] ?? "none" };
  });
  if (told.length === 0) return null;
  const worst = told.reduce((one, other) => (TROUBLE.indexOf(other.tone) > TROUBLE.indexOf(one.tone) ? other : one));
  let words = several && worst.tone !== "none" ? `${worst.robot}: ${worst.words}` : worst.words;
  let { tone } = worst;
  const moving = MOVING[report?.moving ?? ""];
  if (report?.paused) [words, tone] = ["paused", "none"];
  else if (moving !== undefined) [words, tone] = [moving, "good"];
  return { words, tone, name: worst.name, title: told.map((one) => `${one.robot}: ${one.words}`).join("\n") };
}
