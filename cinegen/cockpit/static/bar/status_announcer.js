// The status as it is announced: when it has been the same for a moment, at most every two seconds, and without the numbers in
// it, which change all the time.

const SETTLED = 400; // ms
const APART = 2000; // ms from one announcement to the next
const QUIET = ["IDLE", "FOLLOWING"]; // announced only where they end another status, or where a target is reached
const NUMBERS = / by [\d.,]+ ?(mm|m|rad|°)/g;

/**
 * @typedef {{ name: string, label: string, driven: boolean }} Shown the status that is shown, and whether robots have tasks
 */

export class StatusAnnouncer {
  #said = ""; // what was announced last
  #wanted = ""; // what is shown
  #text = "";
  #since = -Infinity; // ms: the last announcement
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #timer;

  /** @param {(text: string) => void} announce */
  constructor(announce) {
    this.announce = announce;
  }

  /** @param {Shown} shown */
  offer({ name, label, driven }) {
    const key = name === "IDLE" && driven ? "reached" : QUIET.includes(name) && label === name.toLowerCase() ? "" : label.replace(NUMBERS, "");
    this.#text = key === "reached" ? "target reached" : label;
    if (key === this.#wanted) return;
    this.#wanted = key;
    clearTimeout(this.#timer);
    if (key === this.#said) return;
    this.#timer = setTimeout(() => this.#say(), Math.max(SETTLED, this.#since + APART - Date.now()));
  }

  #say() {
    const recovered = this.#wanted === "" && this.#said !== "reached";
    this.#said = this.#wanted;
    if (this.#wanted === "" && !recovered) return;
    this.#since = Date.now();
    this.announce(this.#text);
  }
}
