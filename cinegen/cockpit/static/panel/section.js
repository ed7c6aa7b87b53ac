// A section of the panel: it folds, and remembers whether it is folded.

import { make, memory } from "../base/dom.js";

const LONG = 25; // rows: a list that has more can be filtered

/** `note` is a short text on the right of the heading. */
export class Section {
  /** @type {(() => void) | null} */
  #build = null;

  /** @param {HTMLElement} panel @param {string} id @param {string} title @param {string} hint @param {boolean} open at first */
  constructor(panel, id, title, hint, open = true) {
    this.note = make("span", { class: "note" });
    this.body = make("div", { class: "body" });
    const element = make(
      "details",
      { class: "section", id: `section-${id}`, open: memory.get(`section.${id}`, open) },
      make("summary", { title: hint }, make("h2", {}, title), this.note),
      this.body,
    );
    element.addEventListener("toggle", () => {
      memory.set(`section.${id}`, element.open);
      this.#make();
    });
    this.element = element;
    panel.append(element);
  }

  /** Build its content when it is seen: a robot of a thousand bodies has long lists. @param {() => void} build */
  fill(build) {
    this.#build = build;
    this.#make();
  }

  #make() {
    if (this.#build === null || !this.shown) return;
    const build = this.#build;
    this.#build = null;
    build();
  }

  /** Whether it is seen, but for what is scrolled away; "toggle" of its element tells when that begins. */
  get shown() {
    return this.element.open && !document.body.classList.contains("folded") && !this.element.parentElement?.hidden;
  }
}

/**
 * A field that leaves those rows of a list which contain its text; nothing where the list is short.
 * @param {HTMLElement} list
 * @param {string} rows selector
 * @param {string} label
 */
export function filter(list, rows, label) {
  const all = /** @type {HTMLElement[]} */ ([...list.querySelectorAll(rows)]);
  if (all.length < LONG) return;
  const texts = all.map((row) => (row.title || row.querySelector("[title]")?.getAttribute("title") || "").concat(" ", row.textContent ?? "").toLowerCase());
  const field = make("input", { type: "search", class: "small", placeholder: label, "aria-label": label, title: `${label}: part of a name` });
  field.addEventListener("input", () => all.forEach((row, i) => {
    row.hidden = !texts[i].includes(field.value.toLowerCase());
  }));
  list.prepend(field);
}

/**
 * For each robot a part of a section that folds; where there is one robot only, nothing to fold.
 * @template {{ name: string }} R
 * @param {HTMLElement} body
 * @param {R[]} robots
 * @param {(robot: R, body: HTMLElement) => void} fill
 */
export function byRobot(body, robots, fill) {
  body.replaceChildren();
  for (const robot of robots) {
    const inner = make("div", { class: "body" });
    const part = make(
      "details",
      { class: `robot${robots.length === 1 ? " alone" : ""}`, open: true },
      make("summary", { title: "Show or fold this robot" }, robot.name),
      inner,
    );
    fill(robot, inner);
    body.append(part);
  }
}

/**
 * A part of a section that is folded until it is opened.
 * @param {string} title
 * @param {string} hint
 * @param {...Node} children
 */
export function folded(title, hint, ...children) {
  return make(
    "details",
    { class: "fold" },
    make("summary", { title: hint }, title),
    make("div", { class: "body" }, ...children),
  );
}
