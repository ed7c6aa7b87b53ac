// Text is read in a worker, which is ended and made anew when it takes too long: no text stops the page.

const LONGEST = 10_000; // ms: a busy device needs seconds for a text that takes 0.3 s elsewhere

/**
 * An error or a warning: `text` as `raff2urdf --check` prints it; `line` is 0 where it has no location.
 *
 * @typedef {{ severity: "error" | "warning", message: string, text: string, line: number, column: number, length: number }} Note
 */
/** @typedef {import("../raff/model.js").Model} Model */
/** @typedef {import("../raff/closing/analysis.js").Analysis} Analysis */
/** @typedef {import("../session/solver_interface").Tables} Tables */
/** @typedef {import("../raff/graphics.js").Shown} Shown */
/** @typedef {import("../raff/graphics.js").KnownFile} KnownFile */
/** @typedef {{ model: Model, analysis: Analysis, tables: Tables, graphics: Shown }} ReadRobot */
/** @typedef {{ known: Map<string, KnownFile>, most: { meshes: number, triangles: number } }} Files what the page holds */
/** @typedef {{ text: string, name: string, files: Files }} Question to the worker */
/** @typedef {{ notes: Note[], robots: ReadRobot[] }} Reading robots: none if there are errors */

export class Reader {
  /** @type {Worker | null} */
  #worker = null;
  /** @type {Question | null} */
  #next = null;
  #busy = false;

  /**
   * @param {string} script of the worker
   * @param {Files} files
   * @param {(reading: Reading) => void} read called with what the newest text is
   * @param {number} longest ms
   */
  constructor(script, { known, most }, read, longest = LONGEST) {
    this.url = URL.createObjectURL(new Blob([script], { type: "text/javascript" }));
    this.files = { known, most };
    this.read = read;
    this.longest = longest;
  }

  /**
   * Read a text; of texts that come while one is read, only the last is read.
   *
   * @param {string} text
   * @param {string} name of it
   */
  take(text, name) {
    this.#next = { text, name, files: this.files };
    if (!this.#busy) this.#start();
  }

  #start() {
    const next = this.#next;
    if (next === null) return;
    this.#next = null;
    this.#busy = true;
    this.#worker ??= new Worker(this.url);
    const timer = setTimeout(() => this.#fail(`reading takes more than ${this.longest / 1000} s: shorten the text`), this.longest);
    this.#worker.onmessage = ({ data }) => {
      clearTimeout(timer);
      this.#end(data);
    };
    this.#worker.onerror = (event) => {
      clearTimeout(timer);
      event.preventDefault();
      this.#fail(`the text can't be read: ${event.message}`);
    };
    this.#worker.postMessage(next);
  }

  /** @param {string} message */
  #fail(message) {
    this.#worker?.terminate();
    this.#worker = null;
    this.#end({ notes: [{ severity: "error", message, text: message, line: 0, column: 1, length: 0 }], robots: [] });
  }

  /** @param {Reading} reading */
  #end(reading) {
    this.#busy = false;
    if (this.#next === null) this.read(reading);
    else this.#start();
  }
}
