// GIF animations (GIF89a, https://www.w3.org/Graphics/GIF/spec-gif89a.txt): colours by median cut for each frame,
// unchanged pixels left transparent, and LZW.
//
// This module imports nothing, so that it is a worker's script too: in a page without a server its address is a data
// URL. The worker takes { width, height } first, then { frame, delay } with the pixels of each, and then { end: true };
// it answers with { bytes }.

/** Address of this module, for a worker. */
export const address = import.meta.url;

const BITS = 5; // of each of red, green and blue that colours are told apart by
const COLOURS = 255; // of a frame; the last index is transparent
const TRANSPARENT = 255;
const LARGEST_CODE = 4095;
const BLOCK = 255; // bytes of a block of data

/** @typedef {{ codes: number[], count: number }} Box cells of the histogram, and the number of their pixels */

/** Bytes that grow. */
class Bytes {
  #bytes = new Uint8Array(1 << 16);
  length = 0;

  /** @param {ArrayLike<number>} values */
  push(values) {
    while (this.length + values.length > this.#bytes.length) {
      const larger = new Uint8Array(2 * this.#bytes.length);
      larger.set(this.#bytes);
      this.#bytes = larger;
    }
    this.#bytes.set(values, this.length);
    this.length += values.length;
  }

  /** @param {...number} values of 16 bits */
  short(...values) {
    this.push(values.flatMap((value) => [value & 255, value >> 8]));
  }

  /** All of them. */
  take() {
    return this.#bytes.slice(0, this.length);
  }
}

/** A GIF that repeats for ever. */
export class Gif {
  #out = new Bytes();
  /** @type {Uint32Array | null} */
  #last = null; // pixels of the frame before

  /**
   * @param {{ width: number, height: number }} options pixels
   */
  constructor({ width, height }) {
    this.width = width;
    this.height = height;
    this.#out.push(ascii("GIF89a"));
    this.#out.short(width, height);
    this.#out.push([0, 0, 0]); // no colours that all frames share
    this.#out.push([0x21, 0xff, 11, ...ascii("NETSCAPE2.0"), 3, 1, 0, 0, 0]);
  }

  /**
   * Add a frame.
   *
   * @param {Uint8ClampedArray} pixels red, green, blue and alpha of each, row by row
   * @param {number} delay time until the next frame, hundredths of a second
   */
  add(pixels, delay) {
    const now = new Uint32Array(pixels.buffer, pixels.byteOffset, this.width * this.height);
    const { palette, indices } = quantized(now, this.#last);
    this.#last = now.slice();
    const out = this.#out;
    out.push([0x21, 0xf9, 4, 0b101]); // what is drawn stays, and one index is transparent
    out.short(delay);
    out.push([TRANSPARENT, 0, 0x2c]);
    out.short(0, 0, this.width, this.height);
    out.push([0x87]); // 256 colours of its own
    out.push(palette);
    out.push([8]);
    const data = compressed(indices);
    for (let i = 0; i < data.length; i += BLOCK) {
      const block = data.subarray(i, i + BLOCK);
      out.push([block.length]);
      out.push(block);
    }
    out.push([0]);
  }

  /** Return the file. */
  end() {
    this.#out.push([0x3b]);
    return this.#out.take();
  }
}

/** @param {string} text */
function ascii(text) {
  return [...text].map((character) => character.charCodeAt(0));
}

/**
 * Return the 256 colours (768 bytes) of a frame, and the index of each pixel.
 *
 * @param {Uint32Array} now pixels: alpha, blue, green, red from the highest byte on
 * @param {Uint32Array | null} last pixels of the frame before: those that are equal become transparent
 */
export function quantized(now, last) {
  const size = 1 << (3 * BITS);
  const counts = new Uint32Array(size);
  const sums = new Float64Array(3 * size);
  for (let i = 0; i < now.length; i += 1) {
    if (last !== null && now[i] === last[i]) continue;
    const code = codeOf(now[i]);
    counts[code] += 1;
    sums[3 * code] += now[i] & 255;
    sums[3 * code + 1] += (now[i] >> 8) & 255;
    sums[3 * code + 2] += (now[i] >> 16) & 255;
  }
  const palette = new Uint8Array(768);
  const indexOf = new Uint8Array(size);
  boxes(counts).forEach(({ codes, count }, index) => {
    for (let channel = 0; channel < 3; channel += 1) {
      palette[3 * index + channel] = Math.round(codes.reduce((sum, code) => sum + sums[3 * code + channel], 0) / count);
    }
    for (const code of codes) indexOf[code] = index;
  });
  const indices = Uint8Array.from(now, (pixel, i) => (last !== null && pixel === last[i] ? TRANSPARENT : indexOf[codeOf(pixel)]));
  return { palette, indices };
}

/** @param {number} pixel */
function codeOf(pixel) {
  const drop = 8 - BITS;
  return ((pixel & 255) >> drop) | ((((pixel >> 8) & 255) >> drop) << BITS) | ((((pixel >> 16) & 255) >> drop) << (2 * BITS));
}

/**
 * Divide the cells of a histogram into boxes of similar colours: that with the largest product of pixels and extent first
 * (P. Heckbert, "Color image quantization for frame buffer display", 1982).
 *
 * @param {Uint32Array} counts
 */
function boxes(counts) {
  /** @type {number[]} */
  const all = [];
  counts.forEach((count, code) => {
    if (count > 0) all.push(code);
  });
  const found = all.length > 0 ? [boxOf(all, counts)] : [];
  while (found.length < COLOURS) {
    const worst = found.reduce((one, other) => (other.weight > one.weight ? other : one), { weight: 0, codes: all, count: 0, channel: 0 });
    if (worst.weight === 0) break; // each has one cell
    const shift = BITS * worst.channel;
    const mask = (1 << BITS) - 1;
    worst.codes.sort((a, b) => ((a >> shift) & mask) - ((b >> shift) & mask));
    let middle = 0;
    for (let half = 0; middle < worst.codes.length - 1; middle += 1) {
      half += counts[worst.codes[middle]];
      if (2 * half >= worst.count) break;
    }
    middle = Math.min(middle + 1, worst.codes.length - 1);
    found.splice(found.indexOf(worst), 1, boxOf(worst.codes.slice(0, middle), counts), boxOf(worst.codes.slice(middle), counts));
  }
  return found;
}

/**
 * @param {number[]} codes
 * @param {Uint32Array} counts
 */
function boxOf(codes, counts) {
  let count = 0;
  const [low, high] = [[Infinity, Infinity, Infinity], [-1, -1, -1]];
  for (const code of codes) {
    count += counts[code];
    for (let channel = 0; channel < 3; channel += 1) {
      const value = (code >> (BITS * channel)) & ((1 << BITS) - 1);
      low[channel] = Math.min(low[channel], value);
      high[channel] = Math.max(high[channel], value);
    }
  }
  const extents = high.map((value, i) => value - low[i]);
  const extent = Math.max(...extents);
  return { codes, count, channel: extents.indexOf(extent), weight: count * extent };
}

/**
 * Return bytes compressed by LZW with codes of 9 to 12 bits.
 *
 * @param {Uint8Array} bytes
 */
export function compressed(bytes) {
  const out = new Bytes();
  const [clear, end] = [256, 257];
  const table = new Map();
  let [next, width, buffer, filled] = [end + 1, 9, 0, 0];
  /** @type {number[]} */
  let pending = [];
  const put = (/** @type {number} */ code) => {
    buffer |= code << filled;
    filled += width;
    for (; filled >= 8; filled -= 8) {
      pending.push(buffer & 255);
      buffer >>>= 8;
    }
    if (pending.length < 4096) return;
    out.push(pending);
    pending = [];
  };
  put(clear);
  let prefix = bytes[0];
  for (let i = 1; i < bytes.length; i += 1) {
    const key = (prefix << 8) | bytes[i];
    const known = table.get(key);
    if (known !== undefined) {
      prefix = known;
      continue;
    }
    put(prefix);
    prefix = bytes[i];
    if (next <= LARGEST_CODE) {
      table.set(key, next);
      if (next === 1 << width) width += 1;
      next += 1;
    } else {
      put(clear);
      table.clear();
      [next, width] = [end + 1, 9];
    }
  }
  put(prefix);
  put(end);
  if (filled > 0) pending.push(buffer & 255);
  out.push(pending);
  return out.take();
}

if (typeof window === "undefined" && typeof self !== "undefined" && "postMessage" in self) {
  /** @type {Gif | null} */
  let gif = null;
  self.onmessage = ({ data }) => {
    if (data.frame) gif?.add(data.frame, data.delay);
    else if (data.end) self.postMessage({ bytes: gif?.end() });
    else gif = new Gif(data);
  };
}
