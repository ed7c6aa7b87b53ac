// The bar's menus: what is shown, and snapshots. They close when something else is pressed.
//
// For tests: #aids opens #aids-menu with input[data-aid="ID"] and #bodies (select); #snapshot opens #snapshot-menu.

import { AIDS, BODIES } from "../aids/aids.js";
import { byId, make } from "../base/dom.js";
import { units } from "../base/units.js";

/** @type {Record<string, string>} */
const DRAWN = { parts: "parts", skeleton: "skeletons" };

/** @param {import("../aids/aids.js").Aids} aids */
export function menus(aids) {
  fill(byId("aids-menu"), aids);
  const all = ["aids", "snapshot"].map((id) => ({ button: byId(id), menu: byId(`${id}-menu`) }));
  /**
   * @param {{ button: HTMLElement, menu: HTMLElement }} one
   * @param {boolean} open
   */
  const show = ({ button, menu }, open) => {
    menu.hidden = !open;
    button.setAttribute("aria-expanded", String(open));
    if (!open) return;
    menu.style.transform = ""; // moved in where it would stand out of the window
    const out = menu.getBoundingClientRect().left - 8;
    if (out < 0) menu.style.transform = `translateX(${-out}px)`;
  };
  for (const one of all) {
    one.button.addEventListener("click", () => show(one, one.menu.hidden !== false));
    one.menu.addEventListener("click", (event) => {
      if (event.target instanceof Element && event.target.closest("button, a") !== null) show(one, false);
    });
  }
  window.addEventListener(
    "pointerdown",
    (event) => {
      const target = event.target instanceof Node ? event.target : null;
      for (const one of all) if (!one.menu.parentElement?.contains(target)) show(one, false);
    },
    true,
  );
  window.addEventListener(
    "keydown",
    (event) => {
      if (event.key !== "Escape") return;
      for (const one of all) {
        if (one.menu.hidden) continue;
        show(one, false);
        one.button.focus();
        event.stopImmediatePropagation();
      }
    },
    true,
  );
}

/**
 * @param {HTMLElement} menu
 * @param {import("../aids/aids.js").Aids} aids
 */
function fill(menu, aids) {
  for (const { id, label, hint } of AIDS) {
    const box = make("input", {
      type: "checkbox",
      data: { aid: id },
      on: { change: () => aids.choose(id, box.checked) },
    });
    box.checked = aids.shows(id);
    menu.append(make("label", { title: hint }, box, label));
  }
  const select = make(
    "select",
    {
      class: "small",
      id: "bodies",
      title: "Parts, or lines between the joints, which are drawn faster",
      on: { change: () => aids.draw(select.value) },
    },
    ...BODIES.map((body) => make("option", { value: body }, DRAWN[body])),
  );
  aids.on("change", () => {
    select.value = aids.bodies;
  });
  select.value = aids.bodies;
  const measures = make(
    "select",
    {
      class: "small",
      id: "measures",
      title: "How lengths and angles are shown",
      on: { change: () => units.toggle() },
    },
    ...[units.name, units.other].map((name) => make("option", {}, name)),
  );
  units.on("change", () => {
    measures.value = units.name;
  });
  menu.append(make("hr"), make("label", {}, "Robots as", select), make("label", {}, "Units", measures));
}
