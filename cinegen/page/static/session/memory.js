// The memory of one robot's kernels, see cinegen/page/kernels_module.py: two tables of numbers, D of doubles and I of
// integers. A place is made in them for each field that the kernels use, as large as the robot's sizes say.

/** @typedef {import("./solver_interface").KernelsModule} KernelsModule */
/** @typedef {import("./solver_interface").Kernels} Kernels */
/** @typedef {import("./solver_interface").Tables} Tables */
/** @typedef {import("./solver_interface").Field} Field */
/** @typedef {import("./solver_interface").Values} Values */

/**
 * Return the kernels of a robot, at its configuration q.
 * @param {KernelsModule} module
 * @param {Tables} tables of the robot
 * @returns {Kernels}
 */
export function kernelsOf({ memories, returned, views, statuses, mostTasks, default: create }, { names, robot, clusters }) {
  const places = new Places(returned);
  /** @type {Record<string, number>} what the names in the module's code stand for */
  const symbols = {};
  /** @type {Map<string, [Field, number, number]>} of the robot: where fields are, and their sizes */
  const arrays = new Map();
  const { fields, symbol } = memories.robot;
  const sizeOf = sizesOf(fields, robot);
  for (const [name, field] of Object.entries(fields)) {
    if (field.isParameter) {
      symbols[symbol + name] = sizeOf(name);
      continue;
    }
    const count = countOf(field, sizeOf);
    const begin = places.make(field.table, count, robot[name] ?? field.default);
    symbols[symbol + name] = begin;
    arrays.set(name, [field, begin, count]);
  }
  const tasks = Array.from({ length: mostTasks }, () => ({ n: robot.n }));
  addSeveral(memories.cluster, clusters);
  addSeveral(memories.task, tasks);
  const { D, I } = places.filled();
  const kernels = create(D, I, symbols);
  const viewed = views.map((/** @type {string} */ name) => {
    const [{ table }, begin, count] = /** @type {[Field, number, number]} */ (arrays.get(name));
    return [name, (table === "D" ? D : I).subarray(begin, begin + count)];
  });
  return /** @type {Kernels} */ ({ ...kernels, ...Object.fromEntries(viewed), names: { ...names, statuses } });

  /**
   * Make places for several memories of a kind: one for a table of each number, and of the places of each array.
   * @param {import("./solver_interface").MemoryDeclaration} declaration
   * @param {Values[]} all
   */
  function addSeveral({ fields: declared, symbol: prefix }, all) {
    const sizes = all.map((values) => sizesOf(declared, values));
    for (const [name, field] of Object.entries(declared)) {
      if (field.shape === undefined) {
        symbols[prefix + name] = places.make(field.table, all.length, all.map((values) => numberOf(values[name] ?? field.default)));
        continue;
      }
      const begins = all.map((values, i) => places.make(field.table, countOf(field, sizes[i]), values[name]));
      symbols[prefix + name] = places.make("I", all.length, begins);
    }
  }
}

/** Places in both tables, and the values to fill them with. */
class Places {
  /** @type {["D" | "I", number, number | string | ArrayLike<number | string>][]} */
  #values = [];

  /** @param {number} returned numbers of D that are taken */
  constructor(returned) {
    this.ends = { D: returned, I: 0 };
  }

  /**
   * @param {"D" | "I"} table
   * @param {number} count
   * @param {number | string | ArrayLike<number | string> | undefined} values zeros unless given
   */
  make(table, count, values) {
    const begin = this.ends[table];
    this.ends[table] += count;
    if (values !== undefined) this.#values.push([table, begin, values]);
    return begin;
  }

  filled() {
    const tables = { D: new Float64Array(this.ends.D), I: new Int32Array(this.ends.I) };
    for (const [table, begin, values] of this.#values) {
      const numbers = typeof values === "object" ? Array.from(values, numberOf) : [numberOf(values)];
      if (begin + numbers.length > this.ends[table]) throw new RangeError("a table is larger than its memory");
      tables[table].set(numbers, begin);
    }
    return tables;
  }
}

/**
 * Return a function that returns the value of a parameter of a memory.
 * @param {Record<string, Field>} fields
 * @param {Values} values
 * @returns {(name: string) => number}
 */
function sizesOf(fields, values) {
  return (name) => numberOf(/** @type {number | string} */ (values[name] ?? fields[name].default));
}

/** @param {Field} field @param {(name: string) => number} sizeOf */
function countOf({ shape = [] }, sizeOf) {
  return shape.reduce((/** @type {number} */ count, size) => count * (typeof size === "number" ? size : sizeOf(size)), 1);
}

/** @param {unknown} value a number, or one that JSON has no form of: its name */
function numberOf(value) {
  return Number(value);
}
