// What the bundle codemirror.js holds. It was made in an empty folder with this file in it:
//
//     npm install @codemirror/view@6.43.15 @codemirror/state@6.7.6 @codemirror/commands@6.11.1 @codemirror/lint@6.9.8 esbuild@0.28.2
//     npx esbuild entry.js --bundle --format=esm --minify --legal-comments=none --outfile=codemirror.js
//
// It also holds @codemirror/language 6.13.1, @lezer/common 1.5.5, @lezer/highlight 1.2.5, crelt 1.0.7, style-mod 4.1.5,
// w3c-keyname 2.2.8 and @marijn/find-cluster-break 1.0.4, which these need; all under the licence in LICENSE.

export { Decoration, EditorView, keymap, lineNumbers, ViewPlugin } from "@codemirror/view";
export { EditorState, RangeSetBuilder } from "@codemirror/state";
export { defaultKeymap, history, historyKeymap } from "@codemirror/commands";
export { lintGutter, setDiagnostics } from "@codemirror/lint";
