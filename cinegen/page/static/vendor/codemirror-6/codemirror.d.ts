// Types of what the editor uses of CodeMirror.

export interface Line { number: number; from: number; to: number; text: string }
export interface Text {
  length: number;
  lines: number;
  line(number: number): Line;
  lineAt(position: number): Line;
  toString(): string;
}
export interface Extension { extension?: Extension }
export interface Transaction { newDoc: Text; docChanged: boolean }
export interface TransactionSpec { changes?: { from: number; to: number; insert: string }; selection?: { anchor: number }; scrollIntoView?: boolean }
export class EditorState {
  static create(config: { doc: string; extensions: Extension[] }): EditorState;
  static changeFilter: { of(filter: (transaction: Transaction) => boolean): Extension };
  doc: Text;
  replaceSelection(text: string): TransactionSpec;
}
export class EditorView {
  constructor(config: { state: EditorState; parent: Element });
  static updateListener: { of(listener: (update: { docChanged: boolean }) => void): Extension };
  static domEventHandlers(handlers: { beforeinput: (event: InputEvent, view: EditorView) => boolean }): Extension;
  static contentAttributes: { of(attributes: Record<string, string>): Extension };
  state: EditorState;
  visibleRanges: readonly { from: number; to: number }[];
  dispatch(spec: TransactionSpec): void;
  focus(): void;
}
export interface DecorationSet { size: number }
export class Decoration {
  static mark(spec: { class: string }): Decoration;
}
export class RangeSetBuilder {
  add(from: number, to: number, value: Decoration): void;
  finish(): DecorationSet;
}
export class ViewPlugin {
  static define<T>(
    create: (view: EditorView) => T & { update(update: { docChanged: boolean; viewportChanged: boolean; view: EditorView }): void },
    spec: { decorations: (plugin: T) => DecorationSet },
  ): Extension;
}
export interface Diagnostic { from: number; to: number; severity: "error" | "warning"; message: string }
export const keymap: { of(bindings: readonly object[]): Extension };
export const defaultKeymap: readonly object[];
export const historyKeymap: readonly object[];
export function history(): Extension;
export function lineNumbers(): Extension;
export function lintGutter(): Extension;
export function setDiagnostics(state: EditorState, diagnostics: Diagnostic[]): TransactionSpec;
