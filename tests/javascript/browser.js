// Stand-ins for what the page's modules need of a browser. Import this module before any of the page.

export const root = { dataset: {} };
globalThis.document = { documentElement: root };
globalThis.window = Object.assign(new EventTarget(), { devicePixelRatio: 2 });
globalThis.location = new URL("http://127.0.0.1:7000/?token=a+b");

/** What `localStorage` keeps. */
export const kept = new Map();
globalThis.localStorage = { getItem: (name) => kept.get(name) ?? null, setItem: (name, text) => kept.set(name, text) };

/** A session's line to the server, spoken to by hand: `line.emit("state", ...)`; `line.sent` holds what was sent. */
export async function line() {
  const { Events } = await import("../../cinegen/cockpit/static/base/events.js");
  return Object.assign(new Events(), {
    sent: [],
    owner: "session",
    connected: true,
    configurations: () => null,
    send(object) {
      this.sent.push(object);
    },
  });
}
