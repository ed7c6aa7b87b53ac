// A map as the server sends it (cinegen/cockpit/served_map.py), for tests.

const UNKNOWN = NaN;

/**
 * Return a map of 3 x 2 x 1 cells, 0.1 m wide, with one quantity: { about, arrays }. The value of cell 4 is not known.
 */
export function small({ edges = false } = {}) {
  const indices = [0, 1, 2].flatMap((x) => [0, 1].flatMap((y) => [x, y, 0]));
  const points = indices.map((index) => 0.1 * index);
  const shown = points.length / 3;
  const arrays = {
    numbers: Uint32Array.from({ length: shown }, (_, i) => 10 + i),
    indices: Uint32Array.from(indices),
    points: Float32Array.from(points),
    "value sigma": Float32Array.from([0, 0.25, 0.5, 0.75, UNKNOWN, 1]),
  };
  if (edges) arrays.edges = Float32Array.from({ length: 6 * shown }, (_, i) => [0.1, 0, 0, 0, 0.1, 0][i % 6]);
  const axis = { unit: "m", low: 0, step: 0.1, every: 1, translates: true };
  const about = {
    robot: "arm",
    surface: edges,
    size: 0.1,
    cells: shown,
    done: shown,
    shown,
    axes: [{ ...axis, name: "x", count: 3 }, { ...axis, name: "y", count: 2 }, { ...axis, name: "z", count: 1 }],
    quantity: "sigma",
    quantities: [{ name: "sigma", unit: "1", text: "least singular value", low: 0, high: 1, least: 0, most: 1 }],
  };
  return { about, arrays };
}

/** Return the bytes of map/cells.bin. */
export function block({ about, arrays }) {
  const described = {};
  let at = 0;
  for (const [name, array] of Object.entries(arrays)) {
    described[name] = { at, count: array.length, integer: array instanceof Uint32Array };
    at += array.byteLength;
  }
  let text = JSON.stringify({ ...about, arrays: described });
  text += " ".repeat((4 - (text.length % 4)) % 4);
  const bytes = new Uint8Array(4 + text.length + at);
  new DataView(bytes.buffer).setUint32(0, text.length, true);
  bytes.set(new TextEncoder().encode(text), 4);
  for (const [name, array] of Object.entries(arrays)) {
    bytes.set(new Uint8Array(array.buffer), 4 + text.length + described[name].at);
  }
  return bytes.buffer;
}

/** Make `fetch` answer with a map, until the next call. */
export function serve(map) {
  globalThis.fetch = async (address) => {
    const { pathname } = new URL(address);
    if (pathname === "/map/about.json") return Response.json(map.about);
    if (pathname === "/map/cells.bin") return new Response(block(map));
    return new Response(null, { status: 404 });
  };
}

/** Return a field that has loaded a map. */
export async function loaded(map) {
  const { line } = await import("./browser.js");
  const { Field } = await import("../../cinegen/cockpit/static/map/field.js");
  const session = await line();
  serve(map);
  const field = new Field(session);
  const ready = new Promise((resolve) => field.on("cells", resolve));
  session.emit("hello", { map: "arm" });
  await ready;
  return field;
}
