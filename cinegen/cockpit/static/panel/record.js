// Record: targets and motion are written to a file beside the server.
//
// For tests: #record (aria-pressed), #record-status.

import { make, sign, write } from "../base/dom.js";
import { fixed } from "../base/units.js";
import { Section } from "./section.js";

const HINT = "Write targets and motion to a file, to be replayed or exported to a real robot";

export class Record {
  /**
   * @param {HTMLElement} panel
   * @param {import("../base/session.js").Session} session
   */
  constructor(panel, session) {
    const section = new Section(panel, { id: "record", title: "Mission", hint: HINT });
    this.label = make("span", {}, "Record");
    this.button = make(
      "button",
      {
        type: "button",
        id: "record",
        class: "small",
        "aria-pressed": "false",
        title: HINT,
        on: {
          click: () => {
            if (session.mayAct()) session.send({ type: "set_recording", on: this.button.getAttribute("aria-pressed") !== "true" });
          },
        },
      },
      sign("record"),
      this.label,
    );
    this.status = make("span", { id: "record-status", class: "description quiet" });
    section.body.append(make("div", { class: "head" }, this.button), this.status);
    session.on("report", ({ recording }) => {
      const on = Boolean(recording);
      this.button.setAttribute("aria-pressed", String(on));
      write(this.label, on ? "Stop recording" : "Record");
      write(section.note, on ? `${fixed(recording?.seconds ?? 0, 0)} s` : "");
      const status = recording?.error
        ? recording.error
        : on
          ? `to ${recording?.file}`
          : "cinegen replay shows it, cinegen export hands it on";
      write(this.status, status);
      this.status.classList.toggle("bad", Boolean(recording?.error));
    });
  }
}
