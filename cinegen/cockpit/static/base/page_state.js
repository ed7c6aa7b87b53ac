// States as they come from the server: JSON, and poses as floats behind it; cinegen/cockpit/page_state.py writes them. Only
// nodes that joints move have poses there: those of the others follow from their placements in their parents.

import { Quaternion, Vector3 } from "three";

const HEAD = 8; // bytes: 0, and the length of the JSON
const POSE = 20; // bytes: a position as float32, a quaternion as int16
const ONE = 32767; // stands for 1 in a quaternion

/** Return whether a message is a state, not a drawing command. @param {ArrayBuffer} data */
export function isState(data) {
  return data.byteLength >= HEAD && new Uint8Array(data, 0, 1)[0] === 0;
}

/**
 * Return the state of a message, with the poses of all nodes.
 * @param {ArrayBuffer} data
 * @param {Hello} hello whose robots it is of
 * @returns {State}
 */
export function readState(data, { robots }) {
  const length = new DataView(data).getUint32(4, true);
  const state = JSON.parse(new TextDecoder().decode(new Uint8Array(data, HEAD, length)));
  let at = HEAD + length;
  const next = () => {
    const position = new Float32Array(data, at, 3);
    const turn = Array.from(new Int16Array(data, at + position.byteLength, 4), (part) => part / ONE);
    at += POSE;
    return [...position, ...new Quaternion().fromArray(turn).normalize().toArray()];
  };
  state.poses = Object.fromEntries(
    robots.map(({ name, nodes }) => {
      const numbers = next();
      /** @type {Map<string | null, number[]>} */
      const placed = new Map();
      for (const node of nodes) if (!node.placement) placed.set(node.name, next());
      for (const node of nodes) {
        if (node.placement) placed.set(node.name, below(placed.get(node.parent), node.placement));
        numbers.push(...(placed.get(node.name) ?? []));
      }
      return [name, numbers];
    }),
  );
  return state;
}

/**
 * Return the pose of what is placed in something.
 * @param {number[] | undefined} pose undefined: nothing is above it
 * @param {number[]} placement
 */
function below(pose, placement) {
  if (pose === undefined) return placement;
  const turn = new Quaternion().fromArray(pose, 3);
  const point = new Vector3().fromArray(placement).applyQuaternion(turn).add(new Vector3().fromArray(pose));
  return [...point.toArray(), ...turn.multiply(new Quaternion().fromArray(placement, 3)).toArray()];
}
