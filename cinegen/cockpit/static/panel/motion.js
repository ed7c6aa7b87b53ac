// How robots follow: gain and damping, on log scales.
//
// For tests: #gain, #damping (0 to 1000 on a log scale).

import { significant } from "../base/units.js";
import { Section } from "./section.js";
import { settingSliders } from "./slider.js";

/** @type {import("./slider.js").SettingSlider[]} */
const SETTINGS = [
  { name: "gain", id: "gain", label: "Gain", low: 1, high: 1000, format: (value) => `${significant(value)} /s`,
    hint: "Part of the remaining error that is corrected per second: more is quicker" },
  { name: "damping", id: "damping", label: "Damping", low: 0.001, high: 0.3, format: significant,
    hint: "Below which singular value the motion is damped: more is gentler near singularities, and less exact" },
];

export class Motion {
  /** @param {HTMLElement} panel @param {Session} session */
  constructor(panel, session) {
    const section = new Section(panel, "motion", "Following", "How quickly robots follow, and how gently near singularities", false);
    const { rows, show } = settingSliders(session, SETTINGS);
    section.body.append(...rows);
    session.on("report", ({ settings }) => show(settings));
  }
}
