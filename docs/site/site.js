// What is wider than the page scrolls: then it takes the focus, so that arrow keys scroll it. Where people prefer reduced
// motion, moving pictures stand still.

const WIDE = "pre, .table-wrapper, math[display=block]";

function mark() {
  for (const element of document.querySelectorAll(WIDE)) {
    if (element.scrollWidth > element.clientWidth + 1) element.tabIndex = 0;
    else element.removeAttribute("tabindex");
  }
}

function stop() {
  if (!window.matchMedia("(prefers-reduced-motion: reduce)").matches) return;
  for (const picture of document.querySelectorAll("img[src$='.webp']")) {
    const still = document.createElement("canvas");
    [still.width, still.height] = [picture.naturalWidth, picture.naturalHeight];
    still.getContext("2d").drawImage(picture, 0, 0); // the first frame
    still.setAttribute("role", "img");
    still.setAttribute("aria-label", picture.alt);
    picture.replaceWith(still);
  }
}

window.addEventListener("load", () => {
  mark();
  stop();
});
window.addEventListener("resize", mark);
