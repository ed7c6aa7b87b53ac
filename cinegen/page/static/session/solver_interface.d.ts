// The kinematics of one robot, as the session uses it, and the kernels behind it. Poses are seven numbers: x y z (m) and a
// quaternion x y z w.

export interface SolverTask {
  node: number; // index among the nodes
  offset: ArrayLike<number>; // frame that is constrained, in the node's frame
  target: ArrayLike<number>; // of that frame, in the robot's own world
  translation: number; // number of constrained translations
  rotation: number;
  weight: number;
}

export interface Solver {
  names: { joints: string[]; nodes: string[] }; // of each number of q; of all nodes
  floating: boolean; // q begins with the pose of a floating base
  nq: number;
  q: Float64Array; // home, with closed loops
  mostTasks: number;

  /** Return the poses of all nodes in the robot's own world. */
  fk(q: Float64Array): Float64Array;

  /** Close all loops, in place, with joints locked; return the largest residual, rad or characteristic lengths. */
  close(q: Float64Array, locked: Uint8Array): number;

  /** Return the configuration to which actuated joints lead along a straight line, with closed loops, on this branch;
   * null if they can't get there. */
  follow(q: Float64Array, goal: ArrayLike<number>): Float64Array | null;

  /** Move q, in place, towards the targets of tasks for one period, dt (s). */
  tick(
    q: Float64Array,
    tasks: SolverTask[],
    options: { dt: number; gain: number; damping: number },
  ): { status: string; saturated: number[]; errors: [number, number][]; closure: number };

  /** Return the smallest singular values of the tasks and of the passive joints (dimensionless); null without any. */
  sigma(q: Float64Array, tasks: SolverTask[]): { type1: number | null; type2: number | null };
}

/** A field of a kernel memory: a number, or an array of a shape. */
export interface Field {
  table: "D" | "I";
  default?: number;
  isParameter?: boolean; // it never changes while a robot moves
  shape?: (number | string)[]; // numbers, or names of parameters
}

/** Fields of a memory by name, and the beginning of their names in the kernels' code. */
export interface MemoryDeclaration {
  symbol: string;
  fields: Record<string, Field>;
}

/** The kernels for all mechanisms: see cinegen/page/kernels_module.py. */
export interface KernelsModule {
  memories: { robot: MemoryDeclaration; cluster: MemoryDeclaration; task: MemoryDeclaration };
  views: string[]; // fields of the robot that are used from outside
  statuses: string[];
  returned: number; // numbers at the beginning of D that are taken
  mostTasks: number;
  default(D: Float64Array, I: Int32Array, symbols: Record<string, number>): KernelFunctions;
}

/** Values of a memory's fields by name, as far as they are not 0 or the default; a text such as "Infinity" is a number. */
export type Values = Record<string, number | string | ArrayLike<number | string>>;

/** What the kernels must know of a robot. `velocities`: of each velocity the index in q, or -1; of a floating base, whose
 * pose is the first seven numbers of q, 0 to 5. */
export interface Tables {
  names: { q: string[]; actuated: string[]; nodes: string[]; velocities: number[]; floating: boolean };
  robot: Values;
  clusters: Values[];
}

export interface KernelFunctions {
  place(): void;
  close(): number;
  set_q(): void;
  forward(): boolean;
  take_tasks(): void;
  step(): number;
  find_sigma(): void;
}

/** The kernels of a robot, and views of its memory. */
export interface Kernels extends KernelFunctions {
  names: Tables["names"] & { statuses: string[] };
  q: Float64Array;
  trial: Float64Array;
  locked: Float64Array;
  goal: Float64Array;
  node_frame: Float64Array;
  task_node: Int32Array;
  task_offset: Float64Array;
  task_target: Float64Array;
  task_dof: Int32Array;
  task_weight: Float64Array;
  record_errors: Float64Array;
  record_stopped: Float64Array;
  tasks: Int32Array;
  gain: Float64Array;
  damping_threshold: Float64Array;
  closure: Float64Array;
  sigma_tasks: Float64Array;
  sigma_passive: Float64Array;
}
