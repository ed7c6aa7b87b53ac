// The kinematics of one robot, as a robot's module in the page makes them: its default export returns a `Solver`.

export interface SolverTask {
  node: number; // index among the nodes
  offset: ArrayLike<number>; // frame that is constrained, in the node's frame: x y z (m), quaternion x y z w
  target: ArrayLike<number>; // of that frame, in the robot's own world
  translation: number; // number of constrained translations
  rotation: number;
  weight: number;
}

export interface Solver {
  names: { joints: string[]; nodes: string[] }; // of each value of q; of all nodes
  nq: number;
  q: Float64Array; // home, with closed loops

  /** Return the placements of all nodes in the robot's own world: seven numbers each. */
  fk(q: Float64Array): Float64Array;

  /** Close all loops, in place, with joints locked; return the largest residual, rad or characteristic lengths. */
  close(q: Float64Array, locked: Uint8Array): number;

  /** Move q, in place, towards the targets of tasks for dt (s). */
  tick(
    q: Float64Array,
    tasks: SolverTask[],
    dt: number,
    options: { gain: number; damping: number },
  ): { status: string; saturated: number[]; errors: [number, number][]; closure: number };

  /** Return the smallest singular values of the tasks and of the passive joints (dimensionless); null without any. */
  sigma(q: Float64Array, tasks: SolverTask[]): { type1: number | null; type2: number | null };
}
