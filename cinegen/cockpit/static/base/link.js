// The connection to the server: messages, states, and meshcat's commands, in the order in which things changed.
//
// Events: hello, state, report, notice, problem (with the robots' files, or none), lost (reason), silent (why, where
// nothing comes after that), dropped (reason).
// A state is acknowledged when all listeners have applied it; rendering has no part in that.

import { socketUrl } from "./address.js";
import { Events } from "./events.js";
import { isState, readState } from "./page_state.js";

/**
 * Messages of the server; their types are generated from cinegen/cockpit/messages.py.
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
  /** @type {WebSocket | null} */
  #socket = null;
  /** @type {Hello | null} */
  #hello = null;
  #wait = SOONEST;
  #over = false;
  connected = false;
  /** @type {"session" | "page"} */
  owner = "session"; // of the configuration in the page's address

  /** @param {{ clear: () => void, handle: (command: Uint8Array) => void }} view which the server draws into */
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
   * @returns {[string, Float64Array][] | null}
   */
  configurations() {
    return null;
  }

  connect() {
    const socket = new WebSocket(socketUrl("page"));
    socket.binaryType = "arraybuffer";
    socket.addEventListener("open", () => this.view.clear());
    socket.addEventListener("message", ({ data }) => (typeof data === "string" ? this.#receive(data) : this.#draw(data)));
    socket.addEventListener("close", (event) => this.#close(event));
    this.#socket = socket;
  }

  /** Send a message to the server; it is dropped while there is no connection. @param {ClientMessage} message */
  send(message) {
    if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify(message));
  }

  /** @param {ArrayBuffer} data */
  #draw(data) {
    if (!isState(data)) this.view.handle(new Uint8Array(data));
    else if (this.#hello !== null) this.#show(readState(data, this.#hello));
  }

  /** @param {State} state */
  #show(state) {
    this.emit("state", state);
    this.send({ type: "ack", frame: state.frame ?? 0 });
    document.documentElement.dataset.frame = String(state.frame);
    if (state.report) this.emit("report", state.report);
  }

  /** @param {string} text */
  #receive(text) {
    let message;
    try {
      message = JSON.parse(text);
    } catch {
      return;
    }
    if (message.type === "hello") {
      this.#hello = message;
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

  /** @param {CloseEvent} event */
  #close(event) {
    this.#socket = this.#hello = null;
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
