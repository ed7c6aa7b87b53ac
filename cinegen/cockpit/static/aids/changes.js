// Which reported values have changed: what stays the same is not drawn again.

export class Changes {
  /** @type {Map<string, string>} */
  #last = new Map();

  /**
   * Return whether `value` differs from the last one of `key`, and keep it.
   * @param {string} key
   * @param {unknown} value
   */
  differs(key, value) {
    const text = JSON.stringify(value ?? null);
    if (this.#last.get(key) === text) return false;
    this.#last.set(key, text);
    return true;
  }

  clear() {
    this.#last.clear();
  }
}
