// The line to the server: meshcat's commands on /scene, what moves and what is said on /session.
//
// Events: hello, state, report, notice, open, lost (words), dropped (words).
// A state is applied by whoever listens, and only then acknowledged: rendering has no part in it.

import { Events } from "./events.js";

const SOONEST = 500; // ms to the next try to reach the server
const LATEST = 3000;
const REFUSED = 1008; // the server wants no more of us

export class Link extends Events {
  #sockets = [];
  #wait = SOONEST;
  #over = false;
  connected = false;

  /** @param scene what connects meshcat's viewer to an address and returns its socket */
  constructor(scene) {
    super();
    this.scene = scene;
    document.documentElement.dataset.connected = "no";
    window.addEventListener("pagehide", () => {
      this.#over = true;
    });
  }

  connect() {
    const session = new WebSocket(address("session"));
    const scene = this.scene(address("scene"));
    this.#sockets = [session, scene];
    session.addEventListener("message", (event) => this.#hear(event.data));
    for (const socket of this.#sockets) socket.addEventListener("close", (event) => this.#close(socket, event));
    this.session = session;
  }

  /** Says something to the server; nothing while the line is cut. */
  send(object) {
    if (this.session?.readyState === WebSocket.OPEN) this.session.send(JSON.stringify(object));
  }

  #hear(text) {
    let said;
    try {
      said = JSON.parse(text);
    } catch {
      return;
    }
    if (said.kind === "state") {
      this.tell("state", said);
      if (Number.isFinite(said.frame)) {
        this.send({ ack: said.frame });
        document.documentElement.dataset.frame = String(said.frame);
      }
      if (said.report) this.tell("report", said.report);
    } else if (said.kind === "hello") {
      this.connected = true;
      this.#wait = SOONEST;
      document.documentElement.dataset.connected = "yes";
      this.tell("hello", said);
    } else if (said.kind === "notice") {
      this.tell("notice", said);
    }
  }

  #close(socket, event) {
    if (!this.#sockets.includes(socket)) return; // the other of the two has told it already
    const others = this.#sockets.filter((other) => other !== socket);
    this.#sockets = [];
    for (const other of others) other.close();
    this.connected = false;
    document.documentElement.dataset.connected = "no";
    if (this.#over) return;
    if (event.code === REFUSED) {
      this.tell("dropped", event.reason || "the server refused this page");
      return;
    }
    this.tell("lost", event.reason);
    setTimeout(() => this.connect(), this.#wait);
    this.#wait = Math.min(LATEST, 1.5 * this.#wait);
  }
}

/** A socket's address beside the page's own, with its token. */
function address(name) {
  const url = new URL(beside(name));
  url.protocol = url.protocol.replace("http", "ws");
  return url.href;
}

/** An address beside the page's own, with its token. */
export function beside(name) {
  const url = new URL(name, location.href);
  const token = new URLSearchParams(location.search).get("token");
  if (token !== null) url.searchParams.set("token", token);
  return url.href;
}
