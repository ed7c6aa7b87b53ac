// Colours for numbers: viridis (N. Smith and S. van der Walt), which everyone can tell apart, also in grey.

const STOPS = [
  0x440154, 0x482878, 0x3e4989, 0x31688e, 0x26828e, 0x1f9e89, 0x35b779, 0x6ece58, 0xb5de2b, 0xfde725,
].map((colour) => [(colour >> 16) / 255, ((colour >> 8) & 255) / 255, (colour & 255) / 255]);

export const UNKNOWN = [0.62, 0.62, 0.62]; // of what has no value

/**
 * Red, green and blue of a part, 0 to 1, put into an array from `at` on.
 * @param {number} part
 * @param {number[] | Float32Array} into
 * @param {number} at
 */
export function colour(part, into, at) {
  if (!Number.isFinite(part)) {
    for (let k = 0; k < 3; k += 1) into[at + k] = UNKNOWN[k];
    return;
  }
  const place = Math.min(1, Math.max(0, part)) * (STOPS.length - 1);
  const first = Math.min(Math.floor(place), STOPS.length - 2);
  for (let k = 0; k < 3; k += 1) {
    into[at + k] = STOPS[first][k] + (place - first) * (STOPS[first + 1][k] - STOPS[first][k]);
  }
}

/** The same colours for a bar. */
export const GRADIENT = `linear-gradient(to right, ${STOPS.map(
  (rgb) => `rgb(${rgb.map((part) => Math.round(255 * part)).join(" ")})`,
).join(", ")})`;
