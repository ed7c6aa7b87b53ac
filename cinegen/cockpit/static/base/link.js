// The connections to the server: meshcat's commands on /scene, messages on /session.
//
// Events: hello, state, report, notice, problem (with the robots' files, or none), lost (reason), silent (why, where
// nothing comes after that), dropped (reason).
// A state is acknowledged when all listeners have applied it; rendering has no part in that.

import { socketUrl } from "./address.js";
import { Events } from "./events.js";

/**
 * Messages of the server; their types are generated from cinegen/cockpit/messages.py.
 *
 * @typedef {import("./messages").HelloMessage} Hello
 * @typedef {import("./messages").StateMessage} State
 * @typedef {import("./messages").ReportMessage} Report
 * @typedef {import("./messages").ClientMessage} ClientMessage
 * @typedef {{ text: string, level?: "info" | "warning", action?: { label: string, run: () => void } | null }} Notice
 */

/**
 * @typedef {{ hello: Hello, state: State, report: Report, notice: Notice, problem: string, lost: string,
 *   silent: "gone" | "refused", dropped: string }} ServerEvents
 */

const SOONEST = 500; // ms to the next attempt to connect
const LATEST = 3000;
const PATIENCE = 3000; // ms for an answer of the server
const REFUSED = 1008; // close code: the server refuses this page

/** @extends {Events<ServerEvents>} */
export class Link extends Events {
  /** @type {WebSocket[]} */
  #sockets = [];
  /** @type {WebSocket | null} */
  #session = null;
  #wait = SOONEST;
  #over = false;
  connected = false;
  /** @type {"session" | "page"} */
  owner = "session"; // of the configuration in the page's address

  /** @param {{ connect: (address: string) => WebSocket }} view connects meshcat's viewer to an address and returns its socket */
  constructor(view) {
    super();
    this.view = view;
    document.documentElement.dataset.connected = "no";
    window.addEventListener("pagehide", () => {
      this.#over = true;
    });
  }

  /**
   * Return the present configuration of each robot, by name; null: the session's reports have them.
   *
   * @returns {[string, Float64Array][] | null}
   */
  configurations() {
    return null;
  }

  connect() {
    const session = new WebSocket(socketUrl("session"));
    const scene = this.view.connect(socketUrl("scene"));
    this.#sockets = [session, scene];
    session.addEventListener("message", (event) => this.#receive(event.data));
    for (const socket of this.#sockets) socket.addEventListener("close", (event) => this.#close(socket, event));
    this.#session = session;
  }

  /**
   * Send a message to the server; it is dropped while there is no connection.
   *
   * @param {ClientMessage} message
   */
  send(message) {
    if (this.#session?.readyState === WebSocket.OPEN) this.#session.send(JSON.stringify(message));
  }

  /** @param {string} text */
  #receive(text) {
    let message;
    try {
      message = JSON.parse(text);
    } catch {
      return;
    }
    if (message.type === "state") {
      this.emit("state", message);
      if (Number.isFinite(message.frame)) {
        this.send({ type: "ack", frame: message.frame });
        document.documentElement.dataset.frame = String(message.frame);
      }
      if (message.report) this.emit("report", message.report);
    } else if (message.type === "hello") {
      const known = this.connected; // then other robots have taken the place of those before
      this.connected = true;
      this.#wait = SOONEST;
      document.documentElement.dataset.connected = "yes";
      if (!known) this.emit("problem", ""); // if there is one, it follows
      this.emit("hello", message);
    } else if (message.type === "notice") {
      this.emit("notice", message);
    } else if (message.type === "problem") {
      this.emit("problem", String(message.text ?? ""));
    }
  }

  /** Find out why there is no line: nothing answers at this address, or its token isn't the session's. */
  async #ask() {
    const answer = await fetch(location.href, { cache: "no-store", signal: AbortSignal.timeout(PATIENCE) }).catch(() => null);
    if (!this.connected && answer?.ok !== true) this.emit("silent", answer === null ? "gone" : "refused");
  }

  /**
   * @param {WebSocket} socket
   * @param {CloseEvent} event
   */
  #close(socket, event) {
    if (!this.#sockets.includes(socket)) return; // reported by the other of the two
    const others = this.#sockets.filter((other) => other !== socket);
    this.#sockets = [];
    for (const other of others) other.close();
    this.connected = false;
    document.documentElement.dataset.connected = "no";
    if (this.#over) return;
    if (event.code === REFUSED) {
      this.emit("dropped", event.reason || "the server refused this page");
      return;
    }
    this.emit("lost", event.reason);
    this.#ask();
    setTimeout(() => this.connect(), this.#wait);
    this.#wait = Math.min(LATEST, 1.5 * this.#wait);
  }
}
