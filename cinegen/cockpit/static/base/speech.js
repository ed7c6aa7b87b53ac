// What screen readers read: units as words, values of sliders, and announcements.

import { byId, make } from "./dom.js";

const KEPT = 5; // announcements
const STAYS = 10000; // ms

/** @type {[RegExp, string][]} */
const WORDS = [
  [/(^|[\s(])[-−](?=\d)/g, "$1minus "],
  [/(\d) ?mm\b/g, "$1 millimetres"],
  [/(\d) ?N m\b/g, "$1 newton metres"],
  [/(\d) ?kN m\b/g, "$1 kilonewton metres"],
  [/(\d) ?kN\b/g, "$1 kilonewtons"],
  [/(\d) ?N\b/g, "$1 newtons"],
  [/(\d) ?kg\b/g, "$1 kilograms"],
  [/(\d) ?ms\b/g, "$1 milliseconds"],
  [/(\d) ?m\b/g, "$1 metres"],
  [/(\d) ?s\b/g, "$1 seconds"],
  [/(\d) ?rad\b/g, "$1 radians"],
  [/(\d) ?°/g, "$1 degrees"],
  [/(\d) ?%/g, "$1 percent"],
  [/ ?\/s\b/g, " per second"],
  [/× ?(?=\d)/g, "times "],
  [/ · /g, ", "],
  [/^–$/, "no value"],
];

/** Return a text with its units and signs as words: "minus 12.5 degrees" for "-12.5°". @param {string} text */
export function spoken(text) {
  return WORDS.reduce((spoken, [pattern, word]) => spoken.replace(pattern, word), text);
}

/**
 * Give a slider, a meter or a number field the text that is read as its value.
 * @param {Element} control
 * @param {string} text value with its unit, as it is shown
 */
export function speak(control, text) {
  const words = spoken(text);
  if (control.getAttribute("aria-valuetext") !== words) control.setAttribute("aria-valuetext", words);
}

/** Announce a text: screen readers read it after what they are reading. @param {string} text */
export function announce(text) {
  const line = make("p", {}, spoken(text));
  const region = byId("announcer");
  region.append(line); // what is added is read, what is taken away is not
  while (region.childElementCount > KEPT) region.firstElementChild?.remove();
  setTimeout(() => line.remove(), STAYS);
}
