// Record: targets and motion are written to a file beside the server.
//
// For tests: #record (aria-pressed), #record-status.

import { button, isOn, make, press, sign, write } from "../base/dom.js";
import { fixed } from "../base/units.js";
import { Section } from "./section.js";

const HINT = "Write targets and motion to a file, to be replayed or exported to a real robot";

export class Record {
  /** @param {HTMLElement} panel @param {Session} session */
  constructor(panel, session) {
    const section = new Section(panel, "record", "Mission", HINT);
    this.label = make("span", {}, "Record");
    const send = () => session.command({ type: "set_recording", on: !isOn(this.button) });
    this.button = button({ id: "record", class: "small", "aria-pressed": "false", title: HINT }, send, sign("record"), this.label);
    this.status = make("span", { id: "record-status", class: "description quiet" });
    section.body.append(make("div", { class: "head" }, this.button), this.status);
    session.on("report", ({ recording }) => {
      const on = Boolean(recording);
      press(this.button, on);
      write(this.label, on ? "Stop recording" : "Record");
      write(section.note, on ? `${fixed(recording?.seconds ?? 0, 0)} s` : "");
      const status = on ? `to ${recording?.file}` : "cinegen replay shows it, cinegen export converts it for robots";
      write(this.status, recording?.error || status);
      this.status.classList.toggle("bad", Boolean(recording?.error));
    });
  }
}
