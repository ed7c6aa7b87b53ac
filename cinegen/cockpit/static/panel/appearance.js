// How the scene is shown: visual aids, parts or skeletons, units, the whole of the robots, and headsets.
//
// For tests: #section-show with input[data-aid="ID"], #bodies and #measures (select), #fit, #enter-vr, #enter-ar.

import { AIDS, BODIES } from "../aids/aids.js";
import { make, sign } from "../base/dom.js";
import { units } from "../base/units.js";
import { Section } from "./section.js";

/** @type {Record<string, string>} */
const DRAWN = { parts: "parts", skeleton: "skeletons" };

/** @param {HTMLElement} panel @param {Aids} aids @param {View} view */
export function appearance(panel, aids, view) {
  const { body } = new Section(panel, "show", "Show", "What is drawn besides the robots, and how");
  const boxes = AIDS.map(({ id, label, hint }) => {
    const box = make("input", { type: "checkbox", data: { aid: id }, on: { change: () => aids.choose(id, box.checked) } });
    return { id, box, label: make("label", { title: hint }, box, label) };
  });
  const bodies = choice("bodies", "Parts, or lines between the joints, which are drawn faster", BODIES, DRAWN, (value) => aids.draw(value));
  const measures = choice("measures", "How lengths and angles are shown", [units.name, units.other], {}, () => units.toggle());
  const show = () => {
    for (const { id, box } of boxes) box.checked = aids.shows(id);
    bodies.value = aids.bodies;
  };
  show();
  aids.on("change", show);
  units.on("change", () => {
    measures.value = units.name;
  });
  const fit = make("button", { type: "button", id: "fit", class: "small", title: "Fill the view with the robots (F)", on: { click: () => view.frame() } }, sign("fit"), "Whole robot");
  const headset = [["vr", "virtual reality"], ["ar", "in the room: augmented reality"]].map(([id, mode]) =>
    make("button", { type: "button", id: `enter-${id}`, class: "small", title: `Show the scene in a headset (${mode})`, hidden: true }, id.toUpperCase()));
  body.append(
    make("div", { class: "checks" }, ...boxes.map(({ label }) => label)),
    make("label", { class: "pair" }, "Robots as", bodies),
    make("label", { class: "pair" }, "Units", measures),
    make("div", { class: "buttons" }, fit, ...headset),
  );
}

/**
 * @param {string} id
 * @param {string} title
 * @param {readonly string[]} values
 * @param {Record<string, string>} names
 * @param {(value: string) => void} changed
 */
function choice(id, title, values, names, changed) {
  const select = make("select", { class: "small", id, title }, ...values.map((value) => make("option", { value }, names[value] ?? value)));
  select.addEventListener("change", () => changed(select.value));
  return select;
}
