// Text in the fragment of an address: compressed by deflate, and written in base64url.

export const LARGEST = 1_000_000; // bytes of text; no person writes more
const LONGEST = 100_000; // bytes, compressed: many programs cut longer addresses, and browsers take long for them
const AT_ONCE = 8192; // arguments of a function

/** A fragment that is no text: damaged, or too large. */
export class FragmentError extends Error {}

/**
 * Return the text as a fragment: letters, digits, `-` and `_`.
 *
 * @param {string} text
 * @returns {Promise<string>}
 * @throws {FragmentError} the text is larger than `LARGEST`, or than `LONGEST` when it is compressed
 */
export async function encode(text) {
  const data = new TextEncoder().encode(text);
  if (data.length > LARGEST) throw new FragmentError(`the text has ${data.length} bytes: at most ${LARGEST} are allowed`);
  const stream = new Blob([data]).stream().pipeThrough(new CompressionStream("deflate-raw"));
  const packed = new Uint8Array(await new Response(stream).arrayBuffer());
  if (packed.length > LONGEST) throw new FragmentError("the text is too long for an address, even compressed: keep it in a file");
  let letters = "";
  for (let i = 0; i < packed.length; i += AT_ONCE) letters += String.fromCharCode(...packed.subarray(i, i + AT_ONCE));
  return btoa(letters).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");
}

/**
 * Return the text of a fragment. What decompresses to more than `LARGEST` bytes is given up there.
 *
 * @param {string} fragment
 * @returns {Promise<string>}
 * @throws {FragmentError} it is no text that `encode` made
 */
export async function decode(fragment) {
  if (fragment.length > 2 * LARGEST) throw new FragmentError(`the address is too long: ${fragment.length} characters`);
  if (!/^[\w-]*$/.test(fragment)) throw new FragmentError("the address is damaged: its text is not base64url");
  /** @type {Uint8Array<ArrayBuffer>[]} */
  const parts = [];
  let size = 0;
  try {
    const letters = atob(fragment.replaceAll("-", "+").replaceAll("_", "/"));
    const packed = new Uint8Array(letters.length);
    for (let i = 0; i < packed.length; i += 1) packed[i] = letters.charCodeAt(i);
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
    const reader = stream.getReader();
    for (let part = await reader.read(); !part.done; part = await reader.read()) {
      parts.push(part.value);
      size += part.value.length;
      if (size > LARGEST) {
        await reader.cancel();
        break;
      }
    }
    if (size <= LARGEST) {
      return new TextDecoder("utf-8", { fatal: true, ignoreBOM: true }).decode(await new Blob(parts).arrayBuffer());
    }
  } catch {
    throw new FragmentError("the address is damaged: its text can't be decompressed");
  }
  throw new FragmentError(`the text of the address has more than ${LARGEST} bytes`);
}
