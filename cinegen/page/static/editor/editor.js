// The text beside the robots: CodeMirror, highlighted by the reader's own tokens, with errors at their lines.

import { make } from "../../../cockpit/static/base/dom.js";
import { limits } from "../raff/definitions.js";
import { LARGEST } from "../raff/fragment.js";
import { tokensOfLine } from "../raff/tokens.js";
import {
  Decoration, defaultKeymap, EditorState, EditorView, history, historyKeymap, keymap, lineNumbers, lintGutter, RangeSetBuilder,
  setDiagnostics, ViewPlugin,
} from "../vendor/codemirror-6/codemirror.js";

const SHOWN = 50; // errors
const MUCH = 1000; // characters: more are inserted by the editor, not by the browser, which lays them out first

/** @typedef {import("./reading.js").Note} Note */

export class Editor {
  /**
   * @param {Element} parent
   * @param {string} text
   * @param {() => void} changed
   * @param {(why: string) => void} refused
   */
  constructor(parent, text, changed, refused) {
    this.notes = make("div", { id: "notes", role: "status", "aria-live": "polite" });
    const place = make("div", { id: "text", on: { keydown: (/** @type {Event} */ event) => event.stopPropagation() } });
    parent.append(place, this.notes);
    const state = EditorState.create({
      doc: text,
      extensions: [
        lineNumbers(), lintGutter(), history(), keymap.of([...defaultKeymap, ...historyKeymap]), highlighting(),
        EditorState.changeFilter.of(({ newDoc: { length } }) => {
          if (length > LARGEST) refused(`the text would have ${length} characters: at most ${LARGEST} are allowed`);
          return length <= LARGEST;
        }),
        EditorView.domEventHandlers({ beforeinput: insertMuch }),
        EditorView.updateListener.of(({ docChanged }) => docChanged && changed()),
        EditorView.contentAttributes.of({ "aria-label": "RAFF text", spellcheck: "false", tabindex: "0" }),
      ],
    });
    this.view = new EditorView({ state, parent: place });
  }

  get text() {
    return this.view.state.doc.toString();
  }

  /** @param {string} text */
  set text(text) {
    this.view.dispatch({ changes: { from: 0, to: this.view.state.doc.length, insert: text } });
  }

  /**
   * Show errors and warnings at their lines, and below the text.
   *
   * @param {Note[]} notes
   */
  show(notes) {
    const { state } = this.view;
    const placed = notes.filter(({ line }) => line >= 1 && line <= state.doc.lines).slice(0, SHOWN);
    const diagnostics = placed.map(({ severity, message, line, column, length }) => {
      const { from, text } = state.doc.line(line);
      const begin = units(text, 0, column - 1);
      return { from: from + begin, to: from + units(text, begin, length), severity, message };
    });
    this.view.dispatch(setDiagnostics(state, diagnostics));
    const title = "Go to its line";
    const shown = notes.slice(0, SHOWN).map((note) =>
      make("button", { type: "button", class: note.severity, title, on: { click: () => this.#go(note) } }, note.text),
    );
    const more = notes.length > SHOWN ? [make("p", {}, `and ${notes.length - SHOWN} more`)] : [];
    this.notes.replaceChildren(...shown, ...more);
  }

  /** @param {Note} note */
  #go({ line, column }) {
    const { doc } = this.view.state;
    if (line < 1 || line > doc.lines) return;
    const { from, to } = doc.line(line);
    this.view.dispatch({ selection: { anchor: Math.min(to, from + column - 1) }, scrollIntoView: true });
    this.view.focus();
  }
}

/**
 * Return where a number of characters after a place in a line ends: the reader counts characters, CodeMirror units of UTF-16.
 *
 * @param {string} line
 * @param {number} begin
 * @param {number} count
 */
function units(line, begin, count) {
  let at = begin;
  for (let i = 0; i < count && at < line.length; i += 1) at += /** @type {number} */ (line.codePointAt(at)) > 0xffff ? 2 : 1;
  return at;
}

/**
 * Insert much text at once. What is pasted or dropped does not come here.
 *
 * @param {InputEvent} event
 * @param {EditorView} view
 */
function insertMuch(event, view) {
  if (event.inputType !== "insertText" || (event.data ?? "").length <= MUCH) return false;
  event.preventDefault();
  view.dispatch(view.state.replaceSelection(event.data ?? ""));
  return true;
}

/** Marks of the tokens that are seen. Lines that are too long for the reader have none. */
function highlighting() {
  const build = (/** @type {EditorView} */ view) => {
    const marks = new RangeSetBuilder();
    for (const { from, to } of view.visibleRanges) {
      for (let at = from; at <= to; ) {
        const line = view.state.doc.lineAt(at);
        for (const one of line.text.length > limits.line ? [] : tokensOfLine(line.text)) {
          marks.add(line.from + one.from, line.from + one.to, Decoration.mark({ class: `raff-${one.kind}` }));
        }
        at = line.to + 1;
      }
    }
    return marks.finish();
  };
  return ViewPlugin.define(
    (view) => ({
      marks: build(view),
      update({ docChanged, viewportChanged, view: now }) {
        if (docChanged || viewportChanged) this.marks = build(now);
      },
    }),
    { decorations: ({ marks }) => marks },
  );
}
