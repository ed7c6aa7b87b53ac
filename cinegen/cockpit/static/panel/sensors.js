// Sensors: which node follows which one, what each is doing, how far it is deflected.
//
// For tests: [data-switch="ROBOT/NODE"] select (value: the sensor's id, "" for none), [data-sensor="ID"] with
// data-state, #frame (select), #speed and #turning.

import { choice, make, write } from "../base/dom.js";
import { units } from "../base/units.js";
import { AXES, AxesControl } from "./axes.js";
import { Section } from "./section.js";
import { settingSliders } from "./slider.js";

/** @type {Record<string, string>} */
const TONES = { live: "good", silent: "none", opening: "none", lost: "warn", refused: "bad", closed: "none" };
/** @type {Record<string, string>} */
const FRAMES = { world: "world", base: "base of the robot", tool: "tool", view: "my view" };
/** @type {import("./slider.js").SettingSlider[]} */
const SPEEDS = [
  { name: "linear_speed", id: "speed", label: "Speed", low: 0.001, high: 10, format: (value) => units.speed(value),
    hint: "How fast a fully deflected sensor moves" },
  { name: "angular_speed", id: "turning", label: "Turning", low: 0.01, high: 10, format: (value) => units.turning(value),
    hint: "How fast a fully deflected sensor rotates" },
];
const PORTS = "Name its port when starting: --sensor ID=PORT";

/** @typedef {import("../base/messages").SensorDescription} Sensor */
/**
 * @typedef {{ element: HTMLElement, dot: HTMLElement, state: HTMLElement, message: HTMLElement, count: HTMLElement,
 *   bars: HTMLElement, beams: HTMLElement[], axes: AxesControl, url: string }} Card
 */

export class Sensors {
  /** @type {Map<string, Card>} */
  #cards = new Map();
  /** @type {Map<string, { select: HTMLSelectElement, changed: number }>} */
  #switches = new Map();
  #chosen = -Infinity; // when a command frame was chosen

  /** @param {HTMLElement} panel @param {Session} session */
  constructor(panel, session) {
    this.session = session;
    this.section = new Section(panel, "sensors", "Sensors", "3D mice, gamepads and scripts; each node may follow one of them");
    session.on("hello", (hello) => this.#build(hello));
    session.on("report", (report) => this.#show(report));
  }

  /** @param {Hello} hello */
  #build({ sensors = [], switches = [], frames = [] }) {
    const { body } = this.section;
    body.replaceChildren();
    this.#cards.clear();
    this.#switches.clear();
    if (sensors.length === 0) {
      body.append(make("p", { class: "empty" }, "No sensors. ", PORTS, "."));
      return;
    }
    for (const offered of switches) body.append(this.#switch(offered, sensors));
    this.frame = choice({ id: "frame", "aria-label": "Command frame" }, frames.map((value) => [value, FRAMES[value] ?? value]));
    this.frame.addEventListener("change", () => {
      this.#chosen = performance.now();
      this.session.command({ type: "change_settings", frame: /** @type {import("../base/messages").Settings["frame"]} */ (this.frame?.value) });
    });
    const hint = "Command frame: a deflection of a sensor moves its node along these axes";
    body.append(make("label", { class: "pair", title: hint }, "Command in", this.frame));
    for (const sensor of sensors) body.append(this.#card(sensor));
    this.speeds = settingSliders(this.session, SPEEDS);
    body.append(...this.speeds.rows);
  }

  /** @param {import("../base/messages").SensorSwitch} one @param {Sensor[]} sensors */
  #switch({ robot, node, choices = [] }, sensors) {
    const key = `${robot}/${node}`;
    const whose = this.session.robots.length > 1 ? `${robot} · ${node}` : node;
    const change = () => {
      const entry = this.#switches.get(key);
      if (entry !== undefined) entry.changed = performance.now();
      this.session.command({ type: "select_sensor", robot, node, sensor: select.value === "" ? null : select.value });
    };
    const title = `Sensor that ${whose} follows`;
    const options = choices.map((id) => /** @type {[string, string]} */ ([id ?? "", id === null ? "no sensor" : named(id, sensors)]));
    const select = choice({ title, "aria-label": title, on: { change } }, options);
    this.#switches.set(key, { select, changed: -Infinity });
    return make(
      "label",
      { class: "pair", data: { switch: key } },
      make("span", { class: "description" }, `${whose} follows`),
      select,
    );
  }

  /** @param {Sensor} sensor */
  #card(sensor) {
    const dot = make("span", { class: "dot" });
    const state = make("span", { class: "quiet" });
    const message = make("div", { class: "description quiet" });
    const count = make("div", { class: "number quiet", title: "Packets received, and damaged ones thrown away" });
    const beams = AXES.map(() => make("b"));
    const bars = make(
      "div",
      { class: "deflection", title: "How far it is deflected: translation x y z, rotation rx ry rz" },
      ...AXES.map((axis, i) => make("div", {}, make("div", { class: "beam" }, beams[i]), axis)),
    );
    const axes = new AxesControl(sensor.id, (text) => {
      this.session.command({ type: "change_sensor", sensor: sensor.id, axes: text });
    });
    const element = make(
      "div",
      { class: "card", data: { sensor: sensor.id } },
      make(
        "div",
        { class: "head" },
        dot,
        make("span", { class: "name", title: sensor.url ?? "" }, sensor.kind || sensor.id),
        make("span", { class: "end" }, state),
      ),
      make("div", { class: "description quiet" }, [sensor.id, sensor.url].filter(Boolean).join(" · ")),
      message,
      bars,
      axes.element,
      count,
    );
    this.#cards.set(sensor.id, { element, dot, state, message, count, bars, beams, axes, url: sensor.url ?? "" });
    return element;
  }

  /** @param {SessionReport} report */
  #show({ sensors = [], switches = [], settings }) {
    for (const report of sensors) {
      const card = this.#cards.get(report.id);
      if (card === undefined) continue;
      card.element.dataset.state = report.state ?? "";
      card.dot.dataset.tone = TONES[report.state] ?? "none";
      write(card.state, report.state ?? "");
      write(card.message, report.message && report.message !== report.state ? report.message : "");
      card.message.hidden = card.message.textContent === "";
      const damaged = report.damaged > 0 ? `, ${report.damaged} damaged` : "";
      write(card.count, report.packets > 0 ? `${report.packets} packets${damaged}` : "");
      card.count.hidden = card.count.textContent === "";
      card.axes.show(report.axes);
      card.bars.hidden = !Array.isArray(report.twist);
      card.beams.forEach((beam, i) => {
        const value = Math.min(1, Math.max(-1, report.twist?.[i] ?? 0));
        beam.style.transform = `scaleX(${value.toFixed(3)})`;
      });
    }
    for (const { robot, node, sensor } of switches) {
      const shown = this.#switches.get(`${robot}/${node}`);
      const value = sensor ?? "";
      if (shown === undefined || shown.select.value === value || performance.now() - shown.changed < 800) continue;
      shown.select.value = value;
    }
    const { frame } = this;
    if (frame && settings?.frame && frame.value !== settings.frame && performance.now() - this.#chosen > 800) frame.value = settings.frame;
    this.speeds?.show(settings);
  }
}

/** @param {string} id @param {Sensor[]} sensors */
function named(id, sensors) {
  const what = sensors.find((sensor) => sensor.id === id)?.kind;
  return what ? `${id} · ${what}` : id;
}
