// Addresses next to the page, with its token.

/**
 * Return an address next to the page, with its token.
 *
 * @param {string} name
 */
export function pageUrl(name) {
  const url = new URL(name, location.href);
  const token = new URLSearchParams(location.search).get("token");
  if (token !== null) url.searchParams.set("token", token);
  return url.href;
}

/**
 * Return the address of a socket next to the page, with its token.
 *
 * @param {string} name
 */
export function socketUrl(name) {
  const url = new URL(pageUrl(name));
  url.protocol = url.protocol.replace("http", "ws");
  return url.href;
}
