// A few closed configurations: what holds on one of them holds generically. See `Mechanism.samples` in
// cinegen/model/mechanism.py, whose random numbers are others.

import { normals, rankOf } from "../closing/closure.js";

const WALKED = 3;

/** @typedef {import("../closing/cluster.js").Cluster} Cluster */

/**
 * Return closed configurations, home first, in the model's order.
 *
 * @param {Cluster[]} clusters
 * @param {import("../closing/analysis.js").Analysis} analysis
 * @param {number[]} scale of each joint
 */
export function samplesOf(clusters, { home, met }, scale) {
  const walks = met.map((one) => one.slice(0, WALKED));
  const idle = new Set(home.keys());
  for (const { joints } of clusters) for (const joint of joints) idle.delete(joint);
  const steps = idle.size > 0 ? WALKED : Math.max(0, ...walks.map((walk) => walk.length));
  const normal = normals(clusters.length + 1);
  return [home, ...Array.from({ length: steps }, (_, k) => {
    const q = home.map((value, joint) => (idle.has(joint) ? value + normal() * scale[joint] : value));
    clusters.forEach(({ joints }, i) => {
      const there = walks[i][Math.min(k, walks[i].length - 1)];
      joints.forEach((joint, column) => (q[joint] = there?.[column] ?? q[joint]));
    });
    return q;
  })];
}

/**
 * Return the generic rank of the passive joints' columns in the loops' Jacobian.
 *
 * @param {Cluster[]} clusters
 * @param {number[][]} samples
 * @param {boolean[]} actuated
 */
export function passiveRank(clusters, samples, actuated) {
  return clusters.reduce((sum, cluster) => {
    const columns = [...cluster.joints.keys()].filter((k) => !actuated[cluster.joints[k]]);
    const ranks = samples.map((q) => {
      const { jacobian } = cluster.evaluate(cluster.joints.map((joint) => q[joint]));
      return rankOf(jacobian.map((row) => columns.map((k) => row[k])));
    });
    return sum + Math.max(...ranks);
  }, 0);
}
