// The toolbar beside the selected part: what can be done with it. It stays within the free row of the pane, and leaves while
// the pointer drags.
//
// For tests: #selection with #move #turn (aria-pressed), #pin, #look, #hide, #info (aria-expanded), #deselect; behind #info
// #axes (select), #upright (checkbox) and .about.

import { Vector3 } from "three";
import { atMostEvery, button, byId, choice, make, press, sign, write } from "../base/dom.js";
import { units } from "../base/units.js";
import { AXES } from "../pointer/gizmo.js";

const GAP = 0.16; // of the view's height: room for the gizmo
const OFTEN = 100; // ms
/** @type {Record<string, string>} */
const LABELS = { world: "world axes", local: "its own axes", view: "view axes" };

export class Selection {
  #where = new Vector3();

  /**
   * @param {{ view: View, session: Session, hidden: import("../aids/hidden.js").Hidden,
   *   gizmo: Gizmo, pin: () => void, look: () => void }} parts
   */
  constructor({ view, session, hidden, gizmo, pin, look }) {
    this.view = view;
    this.session = session;
    this.gizmo = gizmo;
    /** @param {string} id @param {string} icon @param {string} title @param {() => void} action */
    const tool = (id, icon, title, action) => button({ id, title, "aria-label": title.replace(/ \(.*| while .*/, "") }, action, sign(icon));
    this.name = make("span", { class: "name" });
    this.move = tool("move", "move", "Move it (W)", () => gizmo.setMode("translate"));
    this.turn = tool("turn", "turn", "Rotate it (E)", () => gizmo.setMode("rotate"));
    this.info = tool("info", "info", "More of it", () => this.#unfold(this.more.hidden !== false));
    const on = { change: () => gizmo.setAxes(this.axes.value) };
    const about = { id: "axes", title: "Along whose axes the arrows are (Q)", "aria-label": "Axes of the gizmo", on };
    this.axes = choice(about, AXES.map((axes) => [axes, LABELS[axes]]));
    this.upright = make("input", { type: "checkbox", id: "upright", on: { change: () => gizmo.setUpright(this.upright.checked) } });
    this.keep = make("label", { class: "field", title: "Constrain its orientation while it is moved" }, this.upright, "keep orientation");
    this.about = make("p", { class: "about empty" });
    this.more = make("div", { class: "more", hidden: true }, this.about, make("div", { class: "tasks" }, this.axes, this.keep));
    this.bar = byId("selection");
    this.bar.append(
      this.name,
      tool("deselect", "close", "Select nothing (Esc)", () => session.select(null, null)),
      this.move,
      this.turn,
      tool("pin", "pin", "Pin it: it stays where it is while other parts are dragged (P)", pin),
      tool("look", "eye", "Look at it: it comes into the middle of the view (L)", look),
      tool("hide", "hidden", "Hide it", () => hidden.hide(session.selected)),
      this.info,
      this.more,
    );
    this.#unfold(false);
    this.free = make("div", { class: "free" });
    view.pane.parentElement?.append(this.free);
    session.on("select", () => this.#show());
    gizmo.on("change", () => this.#show());
    const tell = atMostEvery(OFTEN, () => this.#tell());
    session.on("state", () => tell());
    view.last(() => this.#place());
    for (const box of [this.free, this.bar]) new ResizeObserver(() => this.#place()).observe(box);
  }

  /** @param {boolean} open */
  #unfold(open) {
    this.more.hidden = !open;
    this.info.setAttribute("aria-expanded", String(open));
    this.#tell();
    this.view.changed();
  }

  #show() {
    const { selected } = this.session;
    this.bar.hidden = selected === null;
    if (selected === null) return;
    write(this.name, this.session.called(selected.robot, selected.node));
    const turning = this.gizmo.mode === "rotate";
    press(this.move, !turning);
    press(this.turn, turning);
    this.axes.value = this.gizmo.axes;
    this.upright.checked = this.gizmo.upright;
    this.keep.hidden = turning;
    this.#tell();
  }

  /** What the part is, its joint, and where it is. */
  #tell() {
    const { selected } = this.session;
    if (selected === null || this.more.hidden) return;
    const robot = this.session.robot(selected.robot);
    const node = robot?.byName.get(selected.node);
    const joint = robot?.joints.find(({ name }) => name === node?.joint);
    const { position } = this.view.pose(selected.robot, selected.node, this.#where);
    const at = position.toArray().map((value, i) => `${"xyz"[i]} ${units.length(value)}`);
    const moved = joint && `${joint.actuated ? "actuated" : "passive"} ${joint.type} joint ${joint.name}`;
    write(this.about, [robot?.obstacle ? "obstacle" : (node?.kind ?? ""), moved, at.join(", ")].filter(Boolean).join(" · "));
  }

  /** Put it beside the part, within what is free of the pane. */
  #place() {
    const { selected } = this.session;
    if (selected === null || this.view.headset !== null) return;
    const at = this.view.pixels(this.view.pose(selected.robot, selected.node, this.#where).position, this.#where);
    const [wide, high, gap] = [this.bar.offsetWidth, this.bar.offsetHeight, GAP * this.view.pane.clientHeight];
    const { offsetLeft: left, offsetTop: top, offsetWidth: most, offsetHeight: room } = this.free;
    const [middle, level] = [at?.x ?? left, at?.y ?? top];
    const beside = [middle + gap, middle - gap - wide].find((side) => side >= left && side + wide <= left + most);
    const x = beside ?? middle - wide / 2;
    const y = beside !== undefined ? level - high / 2 : level + gap + high > top + room ? level - gap - high : level + gap;
    const within = (/** @type {number} */ value, /** @type {number} */ end) => Math.round(Math.max(0, Math.min(value, end)));
    this.bar.style.transform = `translate(${within(x - left, most - wide)}px, ${within(y - top, room - high)}px)`;
  }
}
