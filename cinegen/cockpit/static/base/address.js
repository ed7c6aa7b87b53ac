// Addresses next to the page, with its token: that of who may drive, or of who only views.

/** Return an address next to the page, with its token. @param {string} name */
export function pageUrl(name) {
  const url = new URL(name, location.href);
  const query = new URLSearchParams(location.search);
  for (const key of ["token", "view"]) {
    const token = query.get(key);
    if (token !== null) url.searchParams.set(key, token);
  }
  return url.href;
}

/** Return the address of a socket next to the page, with its token. @param {string} name */
export function socketUrl(name) {
  const url = new URL(pageUrl(name));
  url.protocol = url.protocol.replace("http", "ws");
  return url.href;
}
