// Scales of axes: which range is shown, and where its ticks are.

/** @typedef {{ low: number, high: number, log: boolean, ticks: { at: number, text: string }[] }} Scale */

/**
 * Return a linear scale with ticks at 1, 2 or 5 times a power of ten.
 * @param {number} least of the values
 * @param {number} most of them
 * @param {{ smallest: number, count: number, fromZero?: boolean }} options smallest range that is shown; number of ticks
 *   that there is room for; whether the scale begins at zero
 * @returns {Scale}
 */
export function linearScale(least, most, { smallest, count, fromZero = false }) {
  const middle = (least + most) / 2;
  const half = Math.max(0.55 * (most - least), smallest / 2, 1e-12 * Math.abs(middle));
  const [low, high] = fromZero ? [0, Math.max(1.1 * most, smallest)] : [middle - half, middle + half];
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = ([1, 2, 5].find((factor) => factor * power >= rough) ?? 10) * power;
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const ticks = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i += 1) {
    ticks.push({ at: i * step, text: (i === 0 ? 0 : i * step).toFixed(digits) });
  }
  return { low, high, log: false, ticks };
}

/**
 * Return a logarithmic scale with ticks at powers of ten.
 * @param {number} low greater than 0
 * @param {number} high greater than low
 * @returns {Scale}
 */
export function logScale(low, high) {
  const ticks = [];
  for (let power = Math.ceil(Math.log10(low) - 1e-9); power <= Math.log10(high) + 1e-9; power += 1) {
    ticks.push({ at: 10 ** power, text: String(Number((10 ** power).toPrecision(1))) });
  }
  return { low, high, log: true, ticks };
}

/**
 * Return the fraction of a scale at which a value is, clipped to 0 and 1.
 * @param {Scale} scale
 * @param {number} value
 */
export function fractionOf({ low, high, log }, value) {
  const part = log ? Math.log(Math.max(value, low) / low) / Math.log(high / low) : (value - low) / (high - low);
  return Math.min(1, Math.max(0, part));
}
