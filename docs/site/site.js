// What is wider than the page scrolls: then it takes the focus, so that arrow keys scroll it.

const WIDE = "pre, .table-wrapper, math[display=block]";

function mark() {
  for (const element of document.querySelectorAll(WIDE)) {
    if (element.scrollWidth > element.clientWidth + 1) element.tabIndex = 0;
    else element.removeAttribute("tabindex");
  }
}

window.addEventListener("load", mark);
window.addEventListener("resize", mark);
