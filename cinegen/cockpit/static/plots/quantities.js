// Quantities that are plotted: joint positions and singular values of each report, errors of tasks of each state.

import { valueOf } from "../base/names.js";
import { History } from "./history.js";

const LONGEST = 60; // s that are kept
const STATES = 60; // samples of states per second; a headset asks for more
const REPORTS = 15; // of reports; the session sends about ten

/** @typedef {"angles" | "positions" | "distance" | "rotation" | "singular"} Plot */
/**
 * A quantity: its plot, its history with the number of the column, and how people call it. `joint` is an actuated joint's.
 * @typedef {{ key: string, plot: Plot, history: History, column: number, label: string, actuated: boolean }} Quantity
 */

/** @typedef {{ plot: Plot, robot: string, name: string, text: string, actuated: boolean, value: (session: Session) => number }} Source */

const UNITS = { angles: "rad", positions: "m", distance: "m", rotation: "rad", singular: "1" };

export class Quantities {
  #ofReports;
  #ofStates;

  /** @param {KnownRobot[]} robots */
  constructor(robots) {
    this.#ofReports = robots.flatMap((robot) => [...joints(robot), ...singularValues(robot)]);
    this.#ofStates = robots.flatMap(errors);
    this.reports = history(this.#ofReports, REPORTS);
    this.states = history(this.#ofStates, STATES);
    const alone = robots.length === 1;
    /** @type {(sources: Source[], history: History) => Quantity[]} */
    const quantities = (sources, kept) => sources.map(({ plot, robot, name, actuated }, column) => {
        const label = name === "" ? robot : alone ? name : `${robot} · ${name}`;
        return { key: `${plot}/${robot}/${name}`, plot, history: kept, column, label, actuated };
      });
    this.all = [...quantities(this.#ofReports, this.reports), ...quantities(this.#ofStates, this.states)];
  }

  /** Take what a new state has. @param {Session} session */
  sampleState(session) {
    this.states.add(session.state?.time ?? 0, (i) => this.#ofStates[i].value(session));
  }

  /** Take what a new report has. @param {Session} session */
  sampleReport(session) {
    this.reports.add(session.state?.time ?? 0, (i) => this.#ofReports[i].value(session));
  }
}

/** Return a history of quantities. @param {Source[]} sources @param {number} rate samples per second */
function history(sources, rate) {
  const names = sources.map(({ text, plot }) => `${text} (${UNITS[plot]})`);
  return new History(names, { most: rate * LONGEST, period: 1 / rate - 1e-3 });
}

/** @param {KnownRobot} robot @returns {Source[]} */
function joints({ name: robot, joints: all }) {
  return all.map(({ name, type, actuated }, i) => ({
    plot: type === "prismatic" ? "positions" : "angles",
    robot,
    name,
    text: `q of ${robot}/${name}`,
    actuated,
    value: ({ report }) => valueOf(report?.robots, robot)?.q[i] ?? NaN,
  }));
}

/** @param {KnownRobot} robot @returns {Source[]} */
function singularValues({ name: robot, loops, couplings }) {
  const closed = loops.length + couplings.length > 0;
  const kinds = /** @type {("type1" | "type2")[]} */ (closed ? ["type1", "type2"] : ["type1"]);
  return kinds.map((kind) => {
    const name = kind === "type1" ? "lost DoF" : "uncontrolled DoF";
    const text = `singular value of ${robot}: ${name}`;
    return { plot: "singular", robot, name, text, actuated: true, value: ({ report }) => valueOf(report?.robots, robot)?.[kind]?.sigma ?? NaN };
  });
}

/** @param {KnownRobot} robot @returns {Source[]} */
function errors({ name: robot }) {
  return [
    { plot: "distance", robot, name: "", text: `largest error of the tasks of ${robot}`, actuated: true, value: (session) => largest(session, robot, 0) },
    { plot: "rotation", robot, name: "", text: `largest rotation error of the tasks of ${robot}`, actuated: true, value: (session) => largest(session, robot, 1) },
  ];
}

/**
 * Return the largest error of a robot's tasks, m or rad; NaN without tasks.
 * @param {Session} session
 * @param {string} robot
 * @param {0 | 1} part of the error: distance, or rotation
 */
function largest(session, robot, part) {
  let most = NaN;
  for (const task of session.tasks) if (task.robot === robot && !(task.error[part] <= most)) most = task.error[part];
  return most;
}
