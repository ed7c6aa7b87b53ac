// Singular values and vectors of small matrices, and eigenvectors of symmetric ones, by Jacobi's rotations.

/** @typedef {number[][]} Matrix rows */

/**
 * The singular value decomposition: `left[k]` and `right[k]` are the vectors of the value `values[k]`, in no order. Those
 * of zeros are not made.
 *
 * By one-sided rotations (M. R. Hestenes, 1958), which are accurate to rounding for small values, too.
 *
 * @param {Matrix} matrix
 * @returns {{ values: number[], left: number[][], right: number[][] }}
 */
export function svd(matrix) {
  const rows = matrix.length;
  const columns = rows ? matrix[0].length : 0;
  if (rows < columns) {
    const { values, left, right } = svd(transposed(matrix));
    return { values, left: right, right: left };
  }
  const u = transposed(matrix); // columns, made orthogonal
  const v = u.map((_, i) => u.map((__, j) => Number(i === j)));
  for (let sweep = 0, changes = true; changes && sweep < 60; sweep++) {
    changes = false;
    for (let p = 0; p < columns; p++) {
      for (let q = p + 1; q < columns; q++) {
        const [alpha, beta, gamma] = [dot(u[p], u[p]), dot(u[q], u[q]), dot(u[p], u[q])];
        if (gamma === 0 || Math.abs(gamma) <= 1e-16 * Math.sqrt(alpha * beta)) continue;
        changes = true;
        const zeta = (beta - alpha) / (2 * gamma);
        const t = (zeta < 0 ? -1 : 1) / (Math.abs(zeta) + Math.hypot(zeta, 1));
        const c = 1 / Math.hypot(t, 1);
        rotate(u[p], u[q], c, c * t);
        rotate(v[p], v[q], c, c * t);
      }
    }
  }
  const values = u.map((column) => Math.sqrt(dot(column, column)));
  return { values, left: u.map((column, k) => column.map((x) => (values[k] ? x / values[k] : 0))), right: v };
}

/**
 * Eigenvalues and eigenvectors of a symmetric matrix, in no order.
 *
 * @param {Matrix} matrix
 * @returns {{ values: number[], vectors: number[][] }}
 */
export function eigen(matrix) {
  const n = matrix.length;
  const scale = Math.max(...matrix.flat().map(Math.abs)) || 1;
  const m = matrix.map((row) => row.map((value) => value / scale));
  const vectors = m.map((_, i) => m.map((__, j) => Number(i === j)));
  for (let sweep = 0; sweep < 30; sweep++) {
    let largest = 0;
    for (let p = 0; p < n; p++) {
      for (let q = p + 1; q < n; q++) {
        largest = Math.max(largest, Math.abs(m[p][q]));
        if (m[p][q] === 0) continue;
        const half = (m[q][q] - m[p][p]) / (2 * m[p][q]);
        const t = (half < 0 ? -1 : 1) / (Math.abs(half) + Math.hypot(half, 1));
        const c = 1 / Math.hypot(t, 1);
        for (const row of m) [row[p], row[q]] = [c * row[p] - c * t * row[q], c * t * row[p] + c * row[q]];
        rotate(m[p], m[q], c, c * t);
        rotate(vectors[p], vectors[q], c, c * t);
      }
    }
    if (largest < 1e-300) break;
  }
  return { values: m.map((row, i) => row[i] * scale), vectors };
}

/**
 * @param {readonly number[]} a
 * @param {readonly number[]} b
 */
export function dot(a, b) {
  let sum = 0;
  for (let i = 0; i < a.length; i++) sum += a[i] * b[i];
  return sum;
}

/**
 * @param {readonly number[]} a
 * @param {readonly number[]} b
 * @returns {[number, number, number]}
 */
export function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

/** @param {readonly number[]} values */
export function largest(values) {
  return values.reduce((most, value) => Math.max(most, Math.abs(value)), 0);
}

/** @param {Matrix} matrix */
function transposed(matrix) {
  return (matrix[0] ?? []).map((_, j) => matrix.map((row) => row[j]));
}

/**
 * @param {number[]} a
 * @param {number[]} b
 * @param {number} c
 * @param {number} s
 */
function rotate(a, b, c, s) {
  for (let i = 0; i < a.length; i++) {
    const x = a[i];
    const y = b[i];
    a[i] = c * x - s * y;
    b[i] = s * x + c * y;
  }
}
