// Plots: joint positions, errors of tasks and singular values over the last seconds.
//
// For tests: #section-plots; #plots-pause (aria-pressed), #plots-seconds (select), #plots-csv; [data-plot="angles",
// "positions", "distance", "rotation" or "singular"] with a canvas, and a button [data-line="PLOT/ROBOT/NAME"]
// (aria-pressed) for each line.

import { button, choice, isOn, make, memory, press, write } from "../base/dom.js";
import { download } from "../base/download.js";
import { frames } from "../base/frames.js";
import { fixed, significant, units } from "../base/units.js";
import { Chart, styleOf } from "../plots/chart.js";
import { csvOf } from "../plots/history.js";
import { Quantities } from "../plots/quantities.js";
import { linearScale, logScale } from "../plots/scale.js";
import { Section } from "./section.js";

const SECONDS = [10, 30, 60];
const MOST_LINES = 6; // that are shown of a plot initially
const TICKS = 4; // room for the ticks of values

/** @typedef {import("../plots/quantities.js").Plot} Plot */
/** @typedef {import("../plots/quantities.js").Quantity} Quantity */
/** @typedef {{ quantity: Quantity, style: ReturnType<typeof styleOf>, button: HTMLElement, value: HTMLElement }} Line */
/** @typedef {{ plot: Plot, element: HTMLDetailsElement, chart: Chart, unit: HTMLElement, lines: Line[] }} Drawn */

/** What is plotted, as a joint whose values are shown (null: dimensionless), and the smallest range, m or rad. */
const PLOTS = /** @type {const} */ ([
  { plot: "angles", title: "Joint angles", joint: { type: "revolute" }, smallest: 0.01 },
  { plot: "positions", title: "Joint positions", joint: { type: "prismatic" }, smallest: 1e-3 },
  { plot: "distance", title: "Task error", joint: { type: "prismatic" }, smallest: 1e-4 },
  { plot: "rotation", title: "Task error, rotation", joint: { type: "revolute" }, smallest: 1e-3 },
  { plot: "singular", title: "Singular values", joint: null, smallest: 0 },
]);

const HINTS = {
  angles: "Positions of revolute joints. A click on a name shows or hides its line",
  positions: "Positions of prismatic joints. A click on a name shows or hides its line",
  distance: "Largest distance of a task's node from its target",
  rotation: "Largest rotation of a task's node from its target",
  singular: "Smallest singular values, dimensionless: near 0 a DoF is lost, or uncontrolled",
};

export class Plots {
  quantities = new Quantities([]);
  paused = false;
  seconds = SECONDS.includes(memory.get("plots.seconds", 30)) ? memory.get("plots.seconds", 30) : 30;
  /** @type {number | null} */
  #pointer = null; // fraction of the time axis
  /** @type {Drawn[]} */
  #drawn = [];
  /** @type {Set<Drawn>} */
  #waiting = new Set(); // plots to draw, one in each frame

  /** @param {HTMLElement} panel @param {Session} session */
  constructor(panel, session) {
    this.session = session;
    this.section = new Section(panel, "plots", "Plots", "Joints, errors of tasks and singular values over the last seconds", false);
    const pausing = { id: "plots-pause", class: "small", "aria-pressed": "false", title: "Stop the plots, not the robots" };
    this.pause = button(pausing, () => this.#pause(), "Pause");
    const on = { change: () => this.#show(Number(this.window.value)) };
    const back = { id: "plots-seconds", title: "How far back", "aria-label": "Seconds that are plotted", on };
    this.window = choice(back, SECONDS.map((seconds) => [seconds, `${seconds} s`]));
    this.window.value = String(this.seconds);
    const saving = { id: "plots-csv", class: "small", title: "Download all plotted quantities of this time, in m and rad" };
    const csv = button(saving, () => this.#save(), "CSV");
    this.body = make("div", { class: "plots" });
    this.section.body.append(make("div", { class: "head buttons" }, this.pause, this.window, csv), this.body);
    this.section.element.addEventListener("toggle", () => this.redraw());
    session.on("hello", () => this.#build());
    session.on("state", () => {
      if (!this.paused) this.quantities.sampleState(session);
    });
    session.on("report", () => {
      if (this.paused) return;
      this.quantities.sampleReport(session);
      this.redraw();
    });
    units.on("change", () => this.redraw());
    frames.each(() => this.drawNext());
  }

  #build() {
    this.quantities = new Quantities(this.session.robots);
    this.section.fill(() => this.#draw());
  }

  #draw() {
    this.#drawn = PLOTS.map(({ plot, title }) => this.#plot(plot, title)).filter(({ lines }) => lines.length > 0);
    this.body.replaceChildren(...this.#drawn.map(({ element }) => element));
    this.redraw();
  }

  /** @param {Plot} plot @param {string} title @returns {Drawn} */
  #plot(plot, title) {
    const quantities = this.quantities.all.filter((quantity) => quantity.plot === plot);
    const ordered = [...quantities.filter(({ actuated }) => actuated), ...quantities.filter(({ actuated }) => !actuated)];
    const lines = ordered.map((quantity, i) => this.#line(quantity, i));
    for (const line of lines.slice(0, MOST_LINES)) press(line.button, line.quantity.actuated);
    const chart = new Chart((pointer) => {
      this.#pointer = pointer;
      this.redraw();
    });
    chart.canvas.setAttribute("aria-label", `${title} over time`);
    const unit = make("span", { class: "note" });
    const element = make(
      "details",
      { class: "plot", data: { plot }, open: memory.get(`plot.${plot}`, true) },
      make("summary", { title: HINTS[plot] }, title, unit),
      chart.canvas,
      make("div", { class: "lines" }, ...lines.map(({ button }) => button)),
    );
    element.addEventListener("toggle", () => {
      memory.set(`plot.${plot}`, element.open);
      this.redraw();
    });
    return { plot, element, chart, unit, lines };
  }

  /** @param {Quantity} quantity @param {number} number @returns {Line} */
  #line(quantity, number) {
    const style = styleOf(number);
    const value = make("output", { class: "number" });
    const swatch = make("i", { class: "swatch", style: `--line-colour: var(${style.colour})`, data: { dashed: style.dashes.length > 0 ? "yes" : "no" } });
    const text = make("span", { class: "text" }, quantity.label);
    const toggle = () => {
      press(line, !isOn(line));
      this.redraw();
    };
    const about = { class: "line", "aria-pressed": "false", title: `Show or hide ${quantity.label}`, data: { line: quantity.key } };
    const line = button(about, toggle, swatch, text, value);
    return { quantity, style, button: line, value };
  }

  #pause() {
    this.paused = !this.paused;
    press(this.pause, this.paused);
    write(this.pause, this.paused ? "Resume" : "Pause");
  }

  /** @param {number} seconds */
  #show(seconds) {
    this.seconds = seconds;
    memory.set("plots.seconds", seconds);
    this.redraw();
  }

  /** The time at the right end of all plots, s. */
  get #end() {
    const { states, reports } = this.quantities;
    return Math.max(states.newest || 0, reports.newest || 0);
  }

  #save() {
    const { states, reports } = this.quantities;
    const text = csvOf([reports, states], this.#end - this.seconds);
    download(new Blob([text], { type: "text/csv" }), `${this.session.hello?.title ?? "cinegen"}.csv`);
  }

  /** Draw all plots that are open anew, one in each of the next frames. */
  redraw() {
    if (!this.section.shown) return;
    for (const drawn of this.#drawn) if (drawn.element.open) this.#waiting.add(drawn);
  }

  /** Draw the plot that waits first, if any does. */
  drawNext() {
    const [drawn] = this.#waiting;
    if (drawn === undefined) return;
    this.#waiting.delete(drawn);
    const { joint, smallest } = PLOTS[PLOTS.findIndex(({ plot }) => plot === drawn.plot)];
    const shown = (/** @type {number} */ value) => (joint === null ? value : units.shown(joint, value));
    const format = (/** @type {number} */ value) => (joint === null ? significant(value) : fixed(units.shown(joint, value), units.digits(joint)));
    write(drawn.unit, joint === null ? "" : units.unit(joint));
    const lines = drawn.lines.filter((line) => isOn(line.button));
    const to = this.#end;
    const time = this.#pointer === null ? to : to - this.seconds * (1 - this.#pointer);
    for (const { quantity: { history, column }, value } of drawn.lines) {
      const i = history.nearest(time);
      write(value, i < 0 ? "–" : format(history.value(column, i)));
    }
    const { history } = drawn.lines[0].quantity;
    const [least, most] = extremes(history, lines.map(({ quantity }) => quantity.column), to - this.seconds);
    const options = { smallest: shown(smallest), count: TICKS, fromZero: drawn.plot === "distance" || drawn.plot === "rotation" };
    const scale = joint === null ? logScale(1e-3, 1) : linearScale(shown(least), shown(most), options);
    const columns = lines.map(({ quantity: { column }, style }) => ({ column, style }));
    drawn.chart.draw(history, columns, { to, seconds: this.seconds, scale, shown, pointer: this.#pointer });
  }
}

/**
 * Return the least and the greatest of all values of columns; 0 and 0 if there are none.
 * @param {import("../plots/history.js").History} history
 * @param {number[]} columns
 * @param {number} from time, s
 */
export function extremes(history, columns, from) {
  let [least, most] = [Infinity, -Infinity];
  for (let i = history.since(from); i < history.count; i += 1) {
    for (const column of columns) {
      const value = history.value(column, i);
      if (value < least) least = value;
      if (value > most) most = value;
    }
  }
  return least <= most ? [least, most] : [0, 0];
}
