// Samples of several quantities over time, in memory that does not grow.

/** The last samples of named quantities: a ring of rows, each with its time. */
export class History {
  /** @type {Float64Array} */
  #times;
  /** @type {Float64Array[]} */
  #values;
  #first = 0; // row of the oldest sample

  /**
   * @param {string[]} names of the quantities
   * @param {{ most: number, period?: number }} options most rows that are kept; shortest time between two of them, s
   */
  constructor(names, { most, period = 0 }) {
    this.names = names;
    this.most = most;
    this.period = period;
    this.count = 0;
    this.#times = new Float64Array(most);
    this.#values = names.map(() => new Float64Array(most));
  }

  /**
   * Add a sample, unless it is too early; samples of later times, where there are any, are removed.
   * @param {number} time s
   * @param {(index: number) => number} value of each quantity; NaN if it is not known
   */
  add(time, value) {
    while (this.count > 0 && this.time(this.count - 1) > time) this.count -= 1;
    if (this.count > 0 && time - this.time(this.count - 1) < this.period) return;
    if (this.count === this.most) this.#first = (this.#first + 1) % this.most;
    else this.count += 1;
    const row = this.#row(this.count - 1);
    this.#times[row] = time;
    this.#values.forEach((column, i) => {
      column[row] = value(i);
    });
  }

  /** @param {number} i from the oldest sample on */
  #row(i) {
    return (this.#first + i) % this.most;
  }

  /** Return the time of a sample, s. @param {number} i from the oldest sample on */
  time(i) {
    return this.#times[this.#row(i)];
  }

  /** Time of the newest sample, s; NaN if there is none. */
  get newest() {
    return this.count > 0 ? this.time(this.count - 1) : NaN;
  }

  /**
   * Return a value of a sample.
   * @param {number} column number of the quantity
   * @param {number} i from the oldest sample on
   */
  value(column, i) {
    return this.#values[column][this.#row(i)];
  }

  /**
   * Return the number of the first sample that is not earlier than a time; `count` if there is none.
   * @param {number} time s
   */
  since(time) {
    let [low, high] = [0, this.count];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.time(middle) < time) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** Return the number of the sample nearest to a time; -1 if there is none. @param {number} time s */
  nearest(time) {
    const after = this.since(time);
    if (after === 0) return this.count > 0 ? 0 : -1;
    if (after === this.count) return this.count - 1;
    return this.time(after) - time < time - this.time(after - 1) ? after : after - 1;
  }
}

/**
 * Return all samples of several histories as CSV (RFC 4180): a row for each time, an empty cell for what is not known.
 * @param {History[]} histories
 * @param {number} from the first time, s
 */
export function csvOf(histories, from) {
  const lines = [["time (s)", ...histories.flatMap(({ names }) => names)].map(quoted).join(",")];
  const next = histories.map((history) => history.since(from));
  for (;;) {
    const times = histories.map((history, h) => (next[h] < history.count ? history.time(next[h]) : Infinity));
    const time = Math.min(...times);
    if (time === Infinity) break;
    const cells = histories.flatMap((history, h) => {
      const i = times[h] === time ? next[h]++ : -1;
      return history.names.map((_, column) => (i < 0 ? NaN : history.value(column, i)));
    });
    lines.push([time, ...cells].map((value) => (Number.isFinite(value) ? String(value) : "")).join(","));
  }
  return `${lines.join("\r\n")}\r\n`;
}

/** @param {string} text */
function quoted(text) {
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}
