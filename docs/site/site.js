// What is wider than the page scrolls: then it takes the focus, so that arrow keys scroll it. Code can be copied,
// moving pictures paused; where people prefer reduced motion, they are paused at first.

const WIDE = "pre, .table-wrapper, math[display=block]";

function mark() {
  for (const element of document.querySelectorAll(WIDE)) {
    if (element.scrollWidth > element.clientWidth + 1) element.tabIndex = 0;
    else element.removeAttribute("tabindex");
  }
}

/** Return the text of a block of code; of a dialogue with the shell only what is typed. */
function typed(block) {
  const text = block.querySelector("pre").textContent;
  if (!block.matches(".highlight-console")) return text;
  const lines = text.split("\n").filter((line) => line.startsWith("$ "));
  return lines.map((line) => `${line.slice(2)}\n`).join("");
}

/** Add a button to each block of code that copies it; blocks of text are output. */
function offer() {
  if (!navigator.clipboard) return; // an insecure address
  for (const block of document.querySelectorAll("div[class*=highlight-]:not(.highlight-text)")) {
    const button = document.createElement("button");
    button.type = "button";
    button.className = "copy";
    button.textContent = "Copy";
    button.setAttribute("aria-live", "polite");
    button.addEventListener("click", async () => {
      const done = await navigator.clipboard.writeText(typed(block)).then(() => "Copied", () => "Not allowed");
      button.textContent = done;
      setTimeout(() => (button.textContent = "Copy"), 2000);
    });
    block.append(button);
  }
}

/** Add a button to each moving picture that pauses it: its first frame is shown. */
function pause() {
  for (const picture of document.querySelectorAll("img.moving")) {
    const still = document.createElement("canvas");
    [still.width, still.height] = [picture.naturalWidth, picture.naturalHeight];
    still.getContext("2d").drawImage(picture, 0, 0);
    still.setAttribute("role", "img");
    still.setAttribute("aria-label", picture.alt);
    const button = document.createElement("button");
    button.type = "button";
    const show = (moves) => {
      picture.hidden = !moves;
      still.hidden = moves;
      button.textContent = moves ? "Pause" : "Play";
    };
    button.addEventListener("click", () => show(picture.hidden));
    picture.after(still, button);
    picture.parentElement.classList.add("moving");
    show(!window.matchMedia("(prefers-reduced-motion: reduce)").matches);
  }
}

window.addEventListener("load", () => {
  mark();
  offer();
  pause();
});
window.addEventListener("resize", mark);
