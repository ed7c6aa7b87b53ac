// Files that the page makes and the browser saves.

import { make } from "./dom.js";

const KEPT = 60000; // ms: a browser may ask where to save the file before it reads it

/**
 * Save a file.
 * @param {Blob} content
 * @param {string} name of the file; characters that a file system may refuse are replaced
 */
export function download(content, name) {
  const address = URL.createObjectURL(content);
  const link = make("a", { href: address, download: fileName(name) });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(address), KEPT);
}

/** Return a name that file systems accept. @param {string} name */
export function fileName(name) {
  return [...name].map((character) => (character < " " || '/\\:*?"<>|'.includes(character) ? "_" : character)).join("").slice(0, 120);
}
