// A solver of serial arms for the test of the session, which fills in the table: it needs no Python.

const TABLE = {};
const STEP = 1e-6;

const cross = ([a, b, c], [d, e, f]) => [b * f - c * e, c * d - a * f, a * e - b * d];
const rotate = ([x, y, z, w], v) => {
  const t = cross([x, y, z], v).map((component) => 2 * component);
  const u = cross([x, y, z], t);
  return v.map((component, i) => component + w * t[i] + u[i]);
};
const multiply = ([a, b, c, d], [e, f, g, h]) => {
  return [d * e + a * h + b * g - c * f, d * f - a * g + b * h + c * e, d * g + a * f - b * e + c * h, d * h - a * e - b * f - c * g];
};
const compose = (outer, inner) => {
  const moved = rotate(outer.slice(3), inner.slice(0, 3));
  return [...moved.map((x, i) => x + outer[i]), ...multiply(outer.slice(3), inner.slice(3))];
};

function fk(q) {
  const world = [];
  TABLE.joints.forEach(({ parent, placement, axis, prismatic }, i) => {
    const unit = ["x", "y", "z"].map((name) => Number(name === axis));
    const half = q[i] / 2;
    const moved = prismatic ? [...unit.map((x) => x * q[i]), 0, 0, 0, 1]
      : [0, 0, 0, ...unit.map((x) => x * Math.sin(half)), Math.cos(half)];
    const placed = parent < 0 ? placement : compose(world[parent], placement);
    world.push(compose(placed, moved));
  });
  return Float64Array.from(TABLE.nodes.flatMap(({ joint, placement }) => (joint < 0 ? placement : compose(world[joint], placement))));
}

function errorOf(q, { node, offset, target, translation, rotation }) {
  const placed = compose([...fk(q).slice(7 * node, 7 * node + 7)], [...offset]);
  const [x, y, z, w] = multiply([...target].slice(3), [-placed[3], -placed[4], -placed[5], placed[6]]);
  const size = Math.hypot(x, y, z);
  const angle = 2 * Math.atan2(size, Math.abs(w)) * Math.sign(w || 1);
  const turn = [x, y, z].map((component) => (rotation === 3 && size > 0 ? (component / size) * angle : 0));
  return [...placed.slice(0, 3).map((component, i) => (translation === 3 ? target[i] - component : 0)), ...turn];
}

/** Solve (J^T J + damping) x = J^T e by Gauss's elimination. */
function step(q, tasks, part) {
  const n = q.length;
  const rows = (at) => tasks.flatMap((task) => errorOf(at, task).map((row, i) => task.weight * (i < 3 ? row / TABLE.length : row)));
  const error = rows(q);
  const columns = [...q].map((_, j) => rows(q.map((x, i) => x + (i === j ? STEP : 0))).map((x, i) => (error[i] - x) / STEP));
  const dot = (u, v) => u.reduce((sum, x, i) => sum + x * v[i], 0);
  const a = columns.map((column, i) => [...columns.map((other, j) => dot(column, other) + (i === j ? 1e-4 : 0)), part * dot(column, error)]);
  for (let i = 0; i < n; i += 1) {
    for (let k = i + 1; k < n; k += 1) {
      const factor = a[k][i] / a[i][i];
      for (let j = i; j <= n; j += 1) a[k][j] -= factor * a[i][j];
    }
  }
  for (let i = n - 1; i >= 0; i -= 1) {
    for (let j = i + 1; j < n; j += 1) a[i][n] -= a[i][j] * a[j][n];
    a[i][n] /= a[i][i];
  }
  return a.map((row) => row[n]);
}

function tick(q, tasks, { dt, gain }) {
  const saturated = [];
  if (tasks.length > 0) {
    step(q, tasks, 1 - Math.exp(-gain * dt)).forEach((x, i) => {
      q[i] = Math.min(Math.max(q[i] + x, TABLE.lower[i]), TABLE.upper[i]);
      if (q[i] === TABLE.lower[i] || q[i] === TABLE.upper[i]) saturated.push(i);
    });
  }
  const errors = tasks.map((task) => {
    const error = errorOf(q, task);
    return [Math.hypot(...error.slice(0, 3)), Math.hypot(...error.slice(3))];
  });
  const far = errors.some(([metres, angle]) => metres > 1e-6 || angle > 1e-6);
  const status = tasks.length === 0 ? "IDLE" : far && saturated.length > 0 ? "AT_LIMIT" : "FOLLOWING";
  return { status, saturated, errors, closure: 0 };
}

export default () => ({
  names: TABLE.names,
  floating: false,
  nq: TABLE.home.length,
  q: Float64Array.from(TABLE.home),
  fk,
  mostTasks: 16,
  close: () => 0,
  follow: (q, goal) => Float64Array.from(goal),
  tick,
  sigma: () => ({ type1: 0.5, type2: null }),
});
