// Users of the session: a list of all, and the name and colour under which others see this one. Both are kept in this
// browser.
//
// For tests: #section-users; #control (text); #user-name, #user-colour (a button for the next colour), #users with [data-client].

import { make, memory, write } from "../base/dom.js";
import { cleanName, LONGEST } from "../base/names.js";
import { Section } from "../panel/section.js";

export const COLOURS = 8;

const HINT = "Who else is here: others see your name at the part that you point at or drag";

/** @typedef {import("../base/messages").UserInfo} User */

/** Return the name and colour that this browser keeps; a colour by chance, where none is kept. */
export function profile() {
  const colour = memory.get("user.colour", -1);
  const chosen = Number.isInteger(colour) && colour >= 0 && colour < COLOURS ? colour : Math.floor(COLOURS * Math.random());
  memory.set("user.colour", chosen);
  return { name: cleanName(memory.get("user.name", "")), colour: chosen };
}

export class Users {
  /** @param {HTMLElement} panel
   * @param {Session} session */
  constructor(panel, session) {
    this.session = session;
    const { name, colour } = profile();
    this.colour = colour;
    const section = new Section(panel, "users", "Users", HINT, false);
    this.name = make("input", {
      id: "user-name",
      type: "text",
      maxlength: LONGEST,
      "aria-label": "Your name",
      placeholder: "Your name",
      title: "What others see beside your pointer",
      on: { change: () => this.#change() },
    });
    this.name.value = name;
    this.next = make("button", {
      id: "user-colour",
      type: "button",
      class: "small user-dot",
      title: "Another colour",
      "aria-label": "Another colour",
      data: { colour },
      on: {
        click: () => {
          this.colour = (this.colour + 1) % COLOURS;
          this.#change();
        },
      },
    });
    this.list = make("ul", { id: "users", class: "users" });
    const control = make("p", { id: "control", class: "empty", title: "One browser at a time has control: it may drag and switch" });
    section.body.append(make("div", { class: "buttons" }, this.next, this.name), this.list, control);
    const labels = { mine: "You have control.", other: "Another browser has control.", free: "No browser has control." };
    session.on("state", () => write(control, session.viewOnly ? "View only." : labels[session.control]));
    session.on("hello", () => this.#send());
    session.on("state", ({ users }) => {
      if (users) this.#show(users);
    });
    session.on("report", ({ clients }) => write(section.note, clients > 1 ? String(clients) : ""));
  }

  #change() {
    this.name.value = cleanName(this.name.value);
    memory.set("user.name", this.name.value);
    memory.set("user.colour", this.colour);
    this.next.dataset.colour = String(this.colour);
    this.#send();
  }

  #send() {
    const client = this.session.hello?.client ?? 0;
    this.session.send({ type: "set_user", name: this.name.value || `User ${client}`, colour: this.colour });
  }

  /** @param {User[]} users */
  #show(users) {
    const mine = this.session.hello?.client;
    this.list.replaceChildren(
      ...users.map(({ client, name, colour }) =>
        make("li", { data: { client } }, make("i", { class: "user-dot", data: { colour } }), client === mine ? `${name} (you)` : name),
      ),
    );
  }
}
