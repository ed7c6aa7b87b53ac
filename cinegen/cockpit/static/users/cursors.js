// Pointers of users: the part at which this one's is, for the others; and labels with names at those of the others.
//
// For tests: .label.user, data-client = number of the client.

import { Vector3 } from "three";
import { atMostEvery } from "../base/dom.js";

const OFTEN = 100; // ms: the session hands pointers on no more often

/** @typedef {import("../base/messages").UserInfo} User */
/** @typedef {{ robot: string, node: string, point: [number, number, number], dragging: boolean } | null} Cursor */

/**
 * Send the part at which the pointer is while other users are there.
 * @param {{ view: View, session: Session,
 *   drag: Drag }} parts
 */
export function sendCursor({ view, session, drag }) {
  let last = "";
  const send = atMostEvery(OFTEN, (/** @type {Cursor} */ cursor) => {
    if ((session.report?.clients ?? 1) < 2) return;
    const text = JSON.stringify(cursor);
    if (text === last) return;
    last = text;
    session.send({ type: "set_cursor", ...(cursor ?? {}) });
  });
  drag.on("hover", (part) => {
    if (part === null) send(null);
    else send({ robot: part.robot, node: part.node, point: rounded(part.group.worldToLocal(part.point.clone())), dragging: false });
  });
  drag.on("drag", (press) => {
    if (press === null) send(null);
    else send({ robot: press.robot, node: press.node, point: rounded(press.at), dragging: true });
  });
  view.canvas.addEventListener("pointerleave", () => {
    if (drag.part === null) send(null);
  });
  session.on("hello", () => {
    last = "";
  });
}

/** @param {Vector3} point @returns {[number, number, number]} */
function rounded(point) {
  const [x, y, z] = point.toArray().map((value) => Number(value.toFixed(4)));
  return [x, y, z];
}

/** Return the text of a label at another user's pointer; empty where it is at no part. @param {User} user */
export function textOf({ name, robot, dragging }) {
  if (robot === null || robot === undefined) return "";
  return dragging ? `${name} drags` : name;
}

/** Labels at the pointers of other users; they move with the parts. */
export class Cursors {
  /** @type {Map<number, { user: User, point: Vector3 }>} */
  #shown = new Map();

  /** @param {{ view: View, session: Session, labels: Labels }} parts */
  constructor({ view, session, labels }) {
    this.view = view;
    this.session = session;
    this.labels = labels;
    session.on("state", ({ users }) => {
      if (users) this.#take(users);
      this.#place();
    });
    for (const event of /** @type {const} */ (["lost", "dropped"])) session.on(event, () => this.#take([]));
  }

  /** @param {User[]} users */
  #take(users) {
    const others = users.filter((user) => user.client !== this.session.hello?.client && textOf(user) !== "" && this.session.knows(user.robot ?? "", user.node ?? ""));
    const kept = new Set(others.map(({ client }) => client));
    for (const client of this.#shown.keys()) {
      if (kept.has(client)) continue;
      this.labels.put(`user ${client}`, "");
      this.#shown.delete(client);
    }
    for (const user of others) {
      const point = this.#shown.get(user.client)?.point ?? new Vector3();
      this.#shown.set(user.client, { user, point });
      this.labels.put(`user ${user.client}`, textOf(user), point, "user");
      const element = this.labels.all.get(`user ${user.client}`)?.element;
      if (element === undefined) continue;
      element.dataset.client = String(user.client);
      element.dataset.colour = String(user.colour);
    }
  }

  #place() {
    for (const { user, point } of this.#shown.values()) {
      const { position, quaternion } = this.view.pose(user.robot ?? "", user.node ?? "", new Vector3());
      point.fromArray(user.point ?? [0, 0, 0]).applyQuaternion(quaternion).add(position);
    }
  }
}
