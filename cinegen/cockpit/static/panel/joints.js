// Joints: a slider for each actuated joint, from limit to limit, and the values of the passive ones.
//
// For tests: [data-joint="ROBOT/JOINT"] with input[type=range] and input[type=number] in it where the joint is actuated
// (in the units that are shown), data-limit "near" or "at"; passive ones have data-passive and .number.
// [data-lock="ROBOT/JOINT"] (aria-pressed) where joints can be locked, also of a floating base.
// [data-torque="ROBOT/JOINT"] (a meter) where links have masses, data-tone "good", "warn", "bad" or "none".

import { atMostEvery, button, isOn, make, press, sign, write } from "../base/dom.js";
import { sharedBeginnings, valueOf } from "../base/names.js";
import { speak, spoken } from "../base/speech.js";
import { amount, fixed, units } from "../base/units.js";
import { byRobot, filter, folded, Section } from "./section.js";
import { fill } from "./slider.js";

const PICTURE = 1000 / 60;
const OVER = 250; // ms after the report change: the motion ends
const MUCH = 0.8; // of its limit: the bar of a torque turns orange
const UNLOCKED = "Lock it: nothing moves this joint";
const SETTLED = 600; // ms after that: the joint is at rest
/** @type {Record<string, number>} */
const WIDE = { revolute: Math.PI, prismatic: 0.5 }; // to each side of home, where there is no limit; rad, lengths

/** @typedef {import("../base/messages").JointDescription} Joint */
/**
 * @typedef {{ robot: KnownRobot, joint: Joint, lower: number, upper: number, key: string, beginning: string, element: HTMLElement,
 *   pressed: boolean, range: HTMLInputElement, number: HTMLInputElement, torque: HTMLElement | null, bar: HTMLElement,
 *   effort: HTMLElement, mark: HTMLElement, text: HTMLElement }} Row
 */

export class Joints {
  /** @type {Map<string, Row>} */
  #rows = new Map();
  /** @type {{ robot: string, joint: string, lock: HTMLButtonElement }[]} */
  #locks = [];
  /** @type {HTMLElement | null} */
  #lit = null; // the row of the joint that a pointer is on
  /** @type {Row | null} */
  #moving = null; // the row whose slider is moved
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #end;

  /** @param {HTMLElement} panel @param {Session} session */
  constructor(panel, session) {
    this.session = session;
    this.section = new Section(panel, "joints", "Joints", "Move actuated joints one by one; the ends of each bar are the joint's limits");
    this.send = atMostEvery(PICTURE, (/** @type {{ robot: string, joint: string, value: number }} */ move) => session.send({ type: "move_joint", ...move }));
    session.on("hello", () => this.section.fill(() => this.#build()));
    session.on("report", () => this.#show());
    session.on("state", () => this.#hold());
    this.section.element.addEventListener("toggle", () => {
      this.#show();
      this.#hold();
    });
    session.on("over", (part) => this.#light(part));
    units.on("change", () => this.section.fill(() => this.#build()));
  }

  /** @param {Part | null} part whose joint's row is lit */
  #light(part) {
    this.#lit?.classList.remove("lit");
    const joint = part && this.session.robot(part.robot)?.byName.get(part.node)?.joint;
    this.#lit = (joint && this.#rows.get(`${part.robot}/${joint}`)?.element) || null;
    this.#lit?.classList.add("lit");
    if (this.section.shown && !this.#lit?.matches(":hover, :focus-within")) this.#lit?.scrollIntoView({ block: "nearest" });
  }

  #build() {
    this.#rows.clear();
    this.#locks = [];
    this.#moving = null;
    byRobot(this.section.body, this.session.robots, (robot, body) => {
      const cut = sharedBeginnings(robot.joints.map(({ name }) => name));
      const rows = robot.joints.map((joint, i) => this.#row(robot, joint, cut[i]));
      const actuated = rows.filter(({ joint }) => joint.actuated);
      const passive = rows.filter(({ joint }) => !joint.actuated);
      if (robot.root) body.append(make("div", { class: "row base" }, this.#named(robot, robot.root, make("span", { class: "name" }, "Floating base"))));
      this.#grouped(body, actuated);
      if (passive.length > 0) {
        const hint = "Passive joints: loops and couplings move them";
        body.append(folded(`${passive.length} passive`, hint, ...passive.map(({ element }) => element)));
      }
      filter(body, "[data-joint]", "Find a joint");
      if (rows.length === 0) body.append(make("p", { class: "empty" }, "This robot has no joints."));
    });
    this.#show();
  }

  /**
   * Rows, below the beginnings of names that they share where these differ.
   * @param {HTMLElement} body
   * @param {Row[]} rows
   */
  #grouped(body, rows) {
    const several = new Set(rows.map(({ beginning }) => beginning)).size > 1;
    let last = "";
    for (const { beginning, element } of rows) {
      if (several && beginning !== last && beginning !== "") body.append(make("p", { class: "empty" }, beginning.replace(/[_\-./: ]+$/, "")));
      last = beginning;
      body.append(element);
    }
  }

  /**
   * @param {KnownRobot} robot
   * @param {Joint} joint
   * @param {number} cut length of the name's beginning that is not shown
   */
  #row(robot, joint, cut) {
    const home = joint.home ?? 0;
    const wide = (WIDE[joint.type] ?? Math.PI) * (joint.type === "prismatic" ? robot.length : 1);
    /** @type {Row} */
    const row = {
      robot,
      joint,
      lower: joint.lower ?? home - wide,
      upper: joint.upper ?? home + wide,
      key: `${robot.name}/${joint.name}`,
      beginning: joint.name.slice(0, cut),
      element: make("div"),
      pressed: false,
      range: make("input"),
      number: make("input"),
      torque: null,
      bar: make("b"),
      effort: make("span", { class: "number" }),
      mark: make("i"),
      text: make("span", { class: "number" }),
    };
    const limits = Number.isFinite(joint.lower) || Number.isFinite(joint.upper)
        ? `${units.joint(joint, row.lower)} to ${units.joint(joint, row.upper)}`
        : "no limits";
    const coupled = robot.couplings.filter(({ terms }) => Object.hasOwn(terms, joint.name)).map(({ equation }) => `; ${equation} (rad, m)`);
    const title = `${joint.name}: ${joint.type}, ${limits}${coupled.join("")}`;
    const name = this.#named(robot, joint.name, make("span", { class: "name", title }, joint.name.slice(cut)));
    row.element = joint.actuated ? this.#actuated(row, name, limits) : this.#passive(row, name, limits);
    this.#rows.set(row.key, row);
    const node = robot.nodes.find((candidate) => candidate.joint === joint.name)?.name;
    for (const [event, on] of Object.entries({ pointerenter: true, focusin: true, pointerleave: false, focusout: false })) {
      row.element.addEventListener(event, () => this.session.emit("over", on && node !== undefined ? { robot: robot.name, node } : null));
    }
    return row;
  }

  /** A joint's name with its padlock. @param {KnownRobot} robot @param {string} joint @param {HTMLElement} name */
  #named(robot, joint, name) {
    const about = { class: "lock", hidden: true, data: { lock: `${robot.name}/${joint}` }, "aria-pressed": "false", title: UNLOCKED };
    const send = () => this.session.command({ type: "lock_joint", robot: robot.name, joint, locked: !isOn(lock) });
    const lock = button({ ...about, "aria-label": `Lock ${joint} of ${robot.name}` }, send, sign("lock"));
    this.#locks.push({ robot: robot.name, joint, lock });
    return make("span", { class: "lockable" }, lock, name);
  }

  /** @param {Row} row @param {HTMLElement} name @param {string} limits */
  #passive(row, name, limits) {
    return make(
      "div",
      { class: "row passive joint", data: { joint: row.key, passive: "" } },
      name,
      make("div", { class: "track", title: limits }, row.mark),
      row.text,
    );
  }

  /** @param {Row} row @param {HTMLElement} name @param {string} limits */
  #actuated(row, name, limits) {
    const { robot, joint } = row;
    const [min, max] = [row.lower, row.upper].map((value) => units.shown(joint, value));
    const label = `${joint.name} of ${robot.name}`;
    const title = `${limits}. Drag it, or use the arrow keys`;
    row.range = make("input", { type: "range", min, max, step: (max - min) / 1000, "aria-label": label, title });
    row.number = make("input", {
      type: "number",
      min,
      max,
      step: "any",
      "aria-label": `${label}, in ${spoken(`1 ${units.unit(joint)}`).slice(2)}`,
      title: "Type a value and press Enter",
    });
    row.range.addEventListener("pointerdown", () => {
      row.pressed = true;
    });
    for (const end of ["pointerup", "pointercancel"]) {
      row.range.addEventListener(end, () => {
        row.pressed = false;
        if (this.#moving === row) this.#finish(0);
      });
    }
    row.range.addEventListener("input", () => {
      speak(row.range, units.joint(joint, units.meant(joint, Number(row.range.value))));
      this.#move(row, Number(row.range.value));
    });
    row.range.addEventListener("change", () => {
      if (!row.pressed) this.#finish(OVER);
    });
    row.number.addEventListener("change", () => {
      const value = row.number.valueAsNumber;
      if (!Number.isFinite(value)) return;
      this.#move(row, Math.min(Math.max(value, min), max));
      this.#finish(OVER);
      row.number.blur();
    });
    return make(
      "div",
      { class: "row joint", data: { joint: row.key } },
      name,
      row.range,
      make("span", { class: "value" }, row.number, make("span", { class: "unit" }, units.unit(joint))),
      robot.forces.missing ? "" : this.#torque(row),
    );
  }

  /** The torque or force that holds the joint: a bar where there is a limit of it. @param {Row} row */
  #torque(row) {
    const { joint, robot } = row;
    const [what, unit] = kindOf(joint);
    const limit = Number.isFinite(joint.effort);
    row.torque = make(
      "div",
      {
        class: "torque",
        role: "meter",
        data: { torque: row.key, tone: "none" },
        "aria-label": `Holding ${what} of ${joint.name} of ${robot.name}`,
        "aria-valuemin": 0,
        "aria-valuemax": limit ? 100 : undefined,
        "aria-valuenow": 0,
        "aria-valuetext": "not known yet",
        title:
          `The ${what} that holds the robot at rest with its payload` +
          (limit ? `; the bar is its part of the limit, ${amount(joint.effort ?? 0, unit)}` : "; the file states no limit of it (effort)"),
      },
      limit ? make("div", { class: "scale" }, row.bar) : "",
      row.effort,
    );
    return row.torque;
  }

  #hold() {
    if (!this.section.shown) return;
    const torques = this.session.state?.torques ?? {};
    for (const robot of this.session.robots) {
      const holds = valueOf(torques, robot.name);
      if (holds === undefined) continue;
      robot.joints.filter(({ actuated }) => actuated).forEach((joint, i) => {
          const row = this.#rows.get(`${robot.name}/${joint.name}`);
          if (!row?.torque) return;
          const { text, share, tone } = holding(joint, holds[i] ?? null);
          write(row.effort, text);
          if (row.torque.dataset.tone !== tone) row.torque.dataset.tone = tone;
          row.bar.style.transform = `scaleX(${Math.min(1, share).toFixed(3)})`;
          row.torque.setAttribute("aria-valuenow", (100 * share).toFixed(0));
          speak(row.torque, text);
        });
    }
  }

  /** @param {Row} row @param {number} shown */
  #move(row, shown) {
    fill(row.range);
    if (!this.session.mayAct()) return;
    clearTimeout(this.#end);
    this.#moving = row;
    this.send({ robot: row.robot.name, joint: row.joint.name, value: units.meant(row.joint, shown) });
  }

  /** @param {number} wait ms */
  #finish(wait) {
    clearTimeout(this.#end);
    this.#end = setTimeout(() => {
      if (this.#moving === null) return;
      this.#moving = null;
      this.send.flush();
      this.session.send({ type: "end_joint_motion" });
      setTimeout(() => this.#show(), SETTLED); // where nothing moved, no report tells so
    }, wait);
  }

  #show() {
    if (!this.section.shown) return;
    for (const { robot, joint, lock } of this.#locks) {
      const locked = valueOf(this.session.report?.robots, robot)?.locked;
      const row = this.#rows.get(`${robot}/${joint}`);
      lock.hidden = !locked;
      press(lock, locked?.includes(joint) ?? false);
      if (row) row.range.disabled = row.number.disabled = isOn(lock);
      lock.title = isOn(lock) ? "Unlock it" : UNLOCKED;
    }
    for (const robot of this.session.robots) {
      const report = valueOf(this.session.report?.robots, robot.name);
      if (!report) continue;
      const at = new Set(report.saturated);
      const near = new Set(report.near_limit);
      robot.joints.forEach((joint, i) => {
        const row = this.#rows.get(`${robot.name}/${joint.name}`);
        if (row === undefined) return;
        const value = report.q?.[i];
        const limit = at.has(joint.name) ? "at" : near.has(joint.name) ? "near" : "";
        if (row.element.dataset.limit !== limit) row.element.dataset.limit = limit;
        if (Number.isFinite(value)) this.#value(row, value);
      });
    }
  }

  /** @param {Row} row @param {number} value */
  #value(row, value) {
    const { joint } = row;
    const text = fixed(units.shown(joint, value), units.digits(joint));
    if (!joint.actuated) {
      const share = Math.min(1, Math.max(0, (value - row.lower) / (row.upper - row.lower || 1)));
      row.mark.style.left = `${(100 * share).toFixed(1)}%`;
      write(row.text, units.joint(joint, value));
      return;
    }
    if (document.activeElement !== row.number && row.number.value !== text) row.number.value = text;
    if (this.#moving === row || row.pressed) return;
    row.range.value = String(units.shown(joint, value));
    speak(row.range, units.joint(joint, value));
    fill(row.range);
  }
}

/** @param {Joint} joint @returns {[string, string]} what its actuator gives, and the unit */
function kindOf(joint) {
  return joint.type === "prismatic" ? ["force", "N"] : ["torque", "N m"];
}

/**
 * Return the text, the part of the limit (0 without one) and the colour of a holding torque or force.
 * @param {Joint} joint
 * @param {number | null} torque null where none holds
 */
export function holding(joint, torque) {
  const limit = joint.effort ?? Infinity;
  if (torque === null) return { text: "no actuator holds", share: Number.isFinite(limit) ? 1 : 0, tone: "bad" };
  const value = amount(torque, kindOf(joint)[1]);
  if (!Number.isFinite(limit)) return { text: value, share: 0, tone: "none" };
  const share = limit > 0 ? Math.abs(torque) / limit : Math.abs(torque) > 0 ? Infinity : 0;
  const tone = share > 1 ? "bad" : share > MUCH ? "warn" : "good";
  return { text: `${value} · ${Number.isFinite(share) ? `${fixed(100 * share, 0)} %` : "no limit > 0"}`, share, tone };
}
