// The verdict: what the robot does, in a few words. Of several robots the one that is in most trouble speaks.
//
// For tests: #verdict, data-verdict = the verdict's name, data-tone = good, warn, bad or none.

import { atMostEvery, byId, write } from "../base/dom.js";

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
const MOVING = { home: "going home", visit: "going there", undo: "going back", redo: "going on" };

export class Verdict {
  constructor(session) {
    this.session = session;
    this.chip = byId("verdict");
    const show = atMostEvery(100, () => this.#show());
    session.on("state", () => show());
    session.on("report", () => show());
  }

  #show() {
    const { state, report, robots, obstacles } = this.session;
    const told = Object.entries(state?.verdicts ?? {}).map(([robot, { name, words } = {}]) => {
      const text = name === "IDLE" ? IDLE : (words ?? name ?? "");
      return { robot, name, words: text, tone: TONES[name] ?? "none" };
    });
    if (told.length === 0) return;
    const worst = told.reduce((one, other) => (TROUBLE.indexOf(other.tone) > TROUBLE.indexOf(one.tone) ? other : one));
    let words = robots.length + obstacles.length > 1 && worst.tone !== "none" ? `${worst.robot}: ${worst.words}` : worst.words;
    let { tone } = worst;
    if (report?.paused) [words, tone] = ["paused", "none"];
    else if (MOVING[report?.moving]) [words, tone] = [MOVING[report.moving], "good"];
    write(this.chip, words);
    this.chip.dataset.tone = tone;
    this.chip.dataset.verdict = worst.name ?? "";
    this.chip.title = told.map((one) => `${one.robot}: ${one.words}`).join("\n");
  }
}
