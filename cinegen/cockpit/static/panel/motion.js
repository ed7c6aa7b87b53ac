// How robots follow: gain and damping, on log scales.
//
// For tests: #gain, #damping (0 to 1000 on a log scale).

import { make } from "../base/dom.js";
import { significant } from "../base/units.js";
import { Section } from "./section.js";
import { logSlider } from "./slider.js";

export class Motion {
  /**
   * @param {HTMLElement} panel
   * @param {import("../base/session.js").Session} session
   */
  constructor(panel, session) {
    const section = new Section(panel, {
      id: "motion",
      title: "Following",
      hint: "How quickly robots follow, and how gently near singularities",
      open: false,
    });
    /** @param {string} name */
    const change = (name) => (/** @type {number} */ value) => {
      if (session.mayAct()) session.send({ type: "change_settings", [name]: value });
    };
    this.gain = logSlider({
      id: "gain",
      label: "Gain",
      hint: "Part of the remaining error that is corrected per second: more is quicker",
      low: 1,
      high: 1000,
      format: (value) => `${significant(value)} /s`,
      changed: change("gain"),
    });
    this.damping = logSlider({
      id: "damping",
      label: "Damping",
      hint: "Below which singular value the motion is damped: more is gentler near singularities, and less exact",
      low: 0.001,
      high: 0.3,
      format: (value) => significant(value),
      changed: change("damping"),
    });
    for (const [label, slider] of Object.entries({ gain: this.gain, damping: this.damping })) {
      section.body.append(make("label", { class: "pair three" }, label, slider.input, slider.output));
    }
    session.on("report", ({ settings }) => {
      this.gain.show(settings?.gain);
      this.damping.show(settings?.damping);
    });
  }
}
