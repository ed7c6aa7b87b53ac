// Whether what is told differs from what was told last: what stays the same is not drawn again.

export class Fresh {
  /** @type {Map<string, string>} */
  #told = new Map();

  /**
   * Whether `value` is another than that last given under `key`.
   *
   * @param {string} key
   * @param {unknown} value
   */
  is(key, value) {
    const told = JSON.stringify(value ?? null);
    if (this.#told.get(key) === told) return false;
    this.#told.set(key, told);
    return true;
  }

  clear() {
    this.#told.clear();
  }
}
