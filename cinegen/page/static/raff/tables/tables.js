// The tables of a robot for the kernels of the page's solver, made from the model of its text: the same as
// cinegen/page/tables.py makes of Python's mechanism. A base that could move stays where it is.

import { clusters as clustersOf } from "../closing/cluster.js";
import { threes } from "./balls.js";
import { clusterTables } from "./cluster_tables.js";
import { loopsOf, loopTables } from "./loops.js";
import { passiveRank, samplesOf } from "./samples.js";
import { loopScrews } from "./screws.js";
import { frameOf, JointTree } from "./tree.js";

const [REVOLUTE, PRISMATIC] = [1, 2]; // kinds of joints
const STEP_CAP = 0.1; // rad or characteristic lengths in a tick
const PATH = { tolerance: 1e-13, longest_stride: 0.1, most_added: 0.25 }; // of the actuated joints

/** @typedef {import("../model.js").Model} Model */
/** @typedef {import("../closing/analysis.js").Analysis} Analysis */
/** @typedef {import("../closing/cluster.js").Cluster} Cluster */
/** @typedef {import("../kleinfinger.js").Placement} Placement */
/** @typedef {import("../../session/solver_interface").Tables} Tables */
/** @typedef {import("../../session/solver_interface").Values} Values */
/** @typedef {import("./loops.js").Loop} Loop */

/**
 * Return the tables of a model at home.
 *
 * @param {Model} model
 * @param {Analysis} analysis
 * @param {number} rate ticks per second
 * @returns {Tables}
 */
export function tablesOf(model, analysis, rate) {
  const { actuated, length, ranks } = analysis;
  const tree = new JointTree(model);
  const n = tree.joints.length;
  const joints = tree.joints.map(({ joint }) => model.joints[joint]);
  const inTree = (/** @type {ArrayLike<number>} */ values) => tree.joints.map(({ joint }) => values[joint]);
  const all = (/** @type {number} */ value) => new Array(n).fill(value);
  const nodes = [...model.bodies.keys()].filter((i) => model.bodies[i].isNode);
  const clusters = clustersOf(model, length);
  const loops = loopsOf(model, tree);
  const scales = model.joints.map(({ type }) => (type === "prismatic" ? length : 1));
  for (const cluster of clusters) cluster.joints.forEach((joint, k) => (scales[joint] = cluster.scale[k]));
  const [home, scale] = [inTree(analysis.home), inTree(scales)];
  const samples = samplesOf(clusters, analysis, scales);
  const drivers = [...actuated.keys()].filter((joint) => actuated[joint]).map((joint) => tree.at(joint));
  const rank = ranks.reduce((sum, one) => sum + one, 0);
  const mobility = Math.max(n - rank, 0);
  const rows = loops.reduce((sum, loop) => sum + loop.rows, 0) + model.couplings.length;
  const balls = threes(tree, loops, home, { length, locked: new Set(drivers), single: coupledIn(model, tree) });
  const inner = new Set(balls.flatMap((three) => three.slice(0, 2)));
  const members = clusters.map((cluster, i) => clusterTables(cluster, ranks[i], loops, tree));
  const dof = new Set(members.flatMap((one) => one.dof));
  const idle = [...joints.keys()].filter((k) => !dof.has(k));
  const cut = loops.reduce((sum, loop) => sum + loop.cut, 0);
  return {
    names: {
      q: joints.map(({ name }) => name), actuated: drivers.map((k) => joints[k].name), nodes: nodes.map((i) => model.bodies[i].name),
      velocities: [...joints.keys()], floating: false,
    },
    clusters: members,
    robot: {
      nq: n, n, nv: n, bounds: n, joints: n + 1, rank, mobility, most_active: mobility + 1, length, dt: 1 / rate, ...PATH,
      q: home, record_q: home, scale, q_index: [...joints.keys()], frames: [1, 0, 0, 0, 1, 0, 0, 0, 1],
      joint_kind: [0, ...tree.joints.map(({ slides }) => (slides ? PRISMATIC : REVOLUTE))],
      joint_parent: [0, ...tree.joints.map(({ parent }) => parent + 1)],
      joint_q: [0, ...joints.keys()],
      joint_dof: [0, ...joints.keys()],
      joint_axis: [0, 0, 0, ...joints.flatMap(() => [0, 0, 1])],
      joint_offset: [...new Array(12).fill(0), ...tree.joints.flatMap(({ offset }) => frameOf(offset))],
      lower: joints.map(({ lower }) => lower), upper: joints.map(({ upper }) => upper),
      longest_step: joints.map(({ velocity }, k) => Math.min(velocity / rate / scale[k], STEP_CAP)), longest_change: all(Infinity),
      second_derivative: secondDerivative(tree, length),
      actuated: drivers.length, actuated_dof: drivers, goal: drivers.map((k) => home[k]),
      nodes: nodes.length, node_joint: nodes.map((i) => tree.bodies[i].on + 1), node_offset: nodes.flatMap((i) => frameOf(tree.bodies[i].at)),
      node_is_inner: nodes.map((i) => Number(inner.has(tree.bodies[i].on))),
      joint_moved_by: [all(0), ...tree.joints.map(({ movers }) => all(0).map((_, k) => Number(movers.includes(k))))].flat(),
      samples: samples.length, sample: samples.flatMap(inTree),
      balls: balls.length, ball_dof: balls.flat(),
      clusters: clusters.length, idle: idle.length, idle_dof: idle,
      lesser: Math.min(TASK_ROWS, mobility), larger: Math.max(TASK_ROWS, mobility),
      rows, cut, ...loopTables(loops, scale), ...couplingTables(model, clusters, tree),
      ...passiveTables(passiveRank(clusters, samples, actuated), cut),
    },
  };

  /**
   * @param {number} rankOfPassive
   * @param {number} cutDof
   * @returns {Values}
   */
  function passiveTables(rankOfPassive, cutDof) {
    if (rankOfPassive === 0) return {};
    const { mix, lengths, points } = loopScrews(tree, loops, clusters.map(({ loops: own }) => own), home, length);
    const columns = [...actuated.keys()].filter((joint) => !actuated[joint]).map((joint) => tree.at(joint));
    for (let k = n; k < n + cutDof; k += 1) columns.push(k);
    const height = 6 * loops.length + model.couplings.length;
    const clusterOfLoop = loops.map((_, i) => clusters.findIndex(({ loops: own }) => own.includes(i)));
    return {
      screwed: loops.length, screw_rows: height, screw_columns: n + cutDof, screw_clusters: lengths.length, axis_points: points.length,
      screw_mix: mix.flat(), screw_cluster: clusterOfLoop, screw_length: lengths,
      axis_joint: points.map(({ joint }) => joint + 1), axis_cluster: points.map(({ cluster }) => cluster),
      axis_point: points.flatMap(({ point }) => point), axis_share: points.map(({ share }) => share),
      passive: columns.length, passive_column: columns,
      passive_lesser: Math.min(columns.length, height), passive_larger: Math.max(columns.length, height),
      passive_rank: Math.min(rankOfPassive + cutDof, columns.length, height),
    };
  }
}

const TASK_ROWS = 96; // of 16 tasks

/**
 * @param {Model} model
 * @param {Cluster[]} clusters
 * @param {JointTree} tree
 * @returns {Values}
 */
function couplingTables({ couplings, joints }, clusters, tree) {
  if (couplings.length === 0) return {};
  const sizes = couplings.map((_, i) => {
    const cluster = /** @type {Cluster} */ (clusters.find((one) => one.couplings.includes(i)));
    return cluster.sizes[cluster.couplings.indexOf(i)];
  });
  const terms = couplings.flatMap((one, i) => one.terms.map((term) => ({ ...term, i })));
  const degree = Math.max(...terms.map(({ coefficients }) => coefficients.length));
  return {
    couplings: couplings.length, coupled: joints.length, coupling_terms: terms.length, coupling_degree: degree,
    term_coupling: terms.map(({ i }) => i), term_dof: terms.map(({ joint }) => tree.at(joint)),
    term_coefficients: terms.flatMap(({ coefficients, i }) => Array.from({ length: degree }, (_, k) => (coefficients[k] ?? 0) / sizes[i])),
    coupling_constant: couplings.map(({ constant }, i) => constant / sizes[i]),
  };
}

/**
 * Return the joints of the tree that are in couplings.
 *
 * @param {Model} model
 * @param {JointTree} tree
 */
function coupledIn({ couplings }, tree) {
  return new Set(couplings.flatMap(({ terms }) => terms.map(({ joint }) => tree.at(joint))));
}

/**
 * Return a bound of the second derivative of any placement by the joints, in characteristic lengths.
 *
 * @param {JointTree} tree
 * @param {number} length
 */
function secondDerivative({ model, joints, bodies }, length) {
  const size = (/** @type {Placement} */ m) => Math.hypot(m[3], m[7], m[11]);
  let reach = Math.max(...bodies.map(({ at: own }) => size(own)));
  for (const { joint, offset, slides } of joints) {
    const { lower, upper } = model.joints[joint];
    reach += size(offset) + (slides ? Math.max(Math.abs(lower), Math.abs(upper)) : 0);
  }
  return reach / length + 1;
}
