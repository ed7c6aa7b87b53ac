// Read RAFF text into a document, or list every error in it: the same descent by the grammar's table as Python's reader.

import { Block } from "./block.js";
import { counts, labels, limits, numberWithUnit, jointTypes, loopKinds, statements, texts, wanted } from "./definitions.js";
import { Document } from "./document.js";
import { RaffError, SourceText } from "./problems.js";
import { characters, didYouMean, fill } from "./texts.js";
import { locationOf, stringOf, tokensOf } from "./tokens.js";
import { valueOf } from "./values.js";

/** @typedef {import("./problems.js").Location} Location */
/** @typedef {import("./problems.js").Problem} Problem */
/** @typedef {import("./tokens.js").Token} Token */
/** @typedef {import("./values.js").Statement} Statement */

/** @type {Map<string, Map<string, Statement>>} the statements of each kind of block, by their words */
const STATEMENTS = new Map(
  Object.entries(statements).map(([kind, words]) => [kind, new Map(Object.entries(words))]),
);
/** @type {Map<string, string[]>} the tokens that follow a word */
const FOLLOWING = new Map(
  Object.values(statements)
    .flatMap((words) => Object.values(words).map(({ follows }) => follows))
    .map((follows) => [follows, follows ? follows.split(" ") : []]),
);
const LABELS = new Map(Object.entries(labels));
const COUNTS = new Map(Object.entries(counts));
const WANTED = new Map(Object.entries(wanted));
const NUMBER_WITH_UNIT = new RegExp(`^(?:${numberWithUnit})$`);

/**
 * Return the document of a text. Each block is checked by itself; `check` checks the whole.
 *
 * @param {string} text
 * @param {string} [name] of the text, in errors
 * @throws {RaffError} with every problem, up to `limits.problems`
 */
export function parse(text, name = "<text>") {
  const lines = text.split("\n").map((line) => (line.endsWith("\r") ? line.slice(0, -1) : line));
  const source = new SourceText(name, lines);
  for (const [i, line] of lines.entries()) {
    const length = line.length > limits.line ? characters(line) : 0;
    if (length <= limits.line) continue;
    const message = fill(texts.LONG_LINE, { line: i + 1, length, most: limits.line });
    const problem = source.problem(message, { line: i + 1, column: 1, length: 1 });
    problem.text = "";
    throw new RaffError([problem]);
  }
  const reading = new Reading(source);
  const document = reading.run();
  const problems = reading.problems.length ? reading.problems : reading.missing;
  if (document && !problems.length) return document;
  throw new RaffError(problems.slice(0, limits.problems));
}

/** Reading ends here: errors in the remainder of the text would only be guesses. */
class StopReading extends Error {}

/** One pass over a text; it goes on after most errors. */
class Reading {
  /** @param {SourceText} source */
  constructor(source) {
    this.source = source;
    /** @type {Problem[]} */
    this.problems = [];
    /** @type {Problem[]} statements that blocks lack; reported only if there are no other problems */
    this.missing = [];
    this.open = [new Block("", "the file", 1)];
    /** @type {Map<string, { label: string, line: number }>} the last block of each kind, and the line of its end */
    this.closed = new Map();
    this.tokens = tokensOf(source.lines);
    this.current = this.tokens.next().value;
  }

  /**
   * @param {string} message
   * @param {Location} location
   */
  report = (message, location) => {
    this.problems.push(this.source.problem(message, location));
    if (this.problems.length >= limits.problems) throw new StopReading();
  };

  /**
   * Report an error after which nothing more can be understood.
   *
   * @param {string} message
   * @param {Token} token
   * @returns {never}
   */
  stop(message, token) {
    this.report(message, locationOf(token));
    throw new StopReading();
  }

  run() {
    const file = this.open[0];
    try {
      const name = this.header();
      while (!this.ends(file)) this.statement(file);
      return new Document({
        name,
        robots: file.get("robots", []),
        sensors: file.get("sensors", []),
        units: file.get("units", "mm"),
        statesUnits: file.values.has("units"),
        source: this.source,
      });
    } catch (error) {
      if (error instanceof StopReading) return null;
      throw error;
    }
  }

  /** The token to be read next. */
  get token() {
    const { kind, text } = this.current;
    if (kind !== "ILLEGAL") return this.current;
    if (text === '"') this.stop(texts.OPEN_TEXT, this.current);
    if (text === "/") this.stop(texts.LONE_SLASH, this.current);
    return this.stop(fill(texts.UNEXPECTED_CHARACTER, { character: quoted(text) }), this.current);
  }

  /** Return the next token, and advance. */
  take() {
    const token = this.token;
    this.current = this.tokens.next().value;
    return token;
  }

  /** Return the name in the first line. */
  header() {
    const first = this.token;
    if (first.kind !== "END" && first.text !== "RAFF") {
      const hint = first.text.startsWith("<") ? texts.IS_XML : "";
      this.stop(fill(texts.NO_HEADER, { found: first.text, hint }), first);
    }
    this.take();
    if (this.token.kind === "END") this.stop(texts.ENDS_BEFORE_HEADER, this.token);
    if (this.token.line > first.line) this.stop(texts.HEADER_ON_TWO_LINES, first);
    return stringOf(this.expect("NAME"));
  }

  // --- by the table -----------------------------------------------------------------------------------------------------

  /**
   * Read a statement, and add its value to the block.
   *
   * @param {Block} block
   */
  statement(block) {
    const statement = this.token.kind === "WORD" ? wordsOf(block).get(this.token.text) : undefined;
    if (!statement) {
      this.unfitting(block, this.take());
      return;
    }
    const word = this.take();
    /** @type {Token[]} */
    const found = [];
    let inner = block;
    const follows = FOLLOWING.get(statement.follows) ?? [];
    for (const kind of follows) {
      if (kind === "{") {
        const own = LABELS.get(word.text) ?? [word.text, ...found.map((token) => token.text)].join(" ");
        inner = new Block(word.text, own, this.expect(kind).line);
        this.open.push(inner);
      } else if (kind === "}") {
        while (!this.ends(inner)) this.unfitting(inner, this.take());
      } else if (kind === "STRING*") {
        while (this.token.kind === "STRING" || this.token.kind === "WORD") found.push(this.expect("STRING"));
      } else if (kind === "NUMBER" && found.at(-1)?.kind === "MISSING") {
        found.push(found[found.length - 1]);
      } else if (kind.startsWith("NUMBER")) {
        found.push(this.number(word));
        while (kind === "NUMBER+" && this.token.kind !== ")") {
          found.push(this.expect(this.token.kind === "NUMBER" ? "NUMBER" : "MORE"));
        }
      } else {
        const token = this.expect(kind);
        if (kind !== "(" && kind !== ")") found.push(token);
      }
    }
    const location = locationOf(found.length && block.kind !== "parameters" ? found[0] : word);
    const opens = follows.at(-1) === "{";
    if (opens) {
      while (!this.ends(inner)) this.statement(inner);
      for (const [name, { required, unless }] of wordsOf(inner)) {
        if (required === undefined || inner.values.has(name) || (unless && inner.values.has(unless))) continue;
        const message = fill(texts.LACKS, { label: inner.label, word: name, meaning: required });
        this.missing.push(this.source.problem(message, location));
      }
    }
    const value = valueOf(this.report, block.kind, word, statement, found, opens ? inner : null);
    block.add(this.report, statement, word.text, value, location);
  }

  /**
   * Return whether a block ends here, and read its closing brace.
   *
   * @param {Block} block
   */
  ends(block) {
    if (this.token.kind === "END") {
      if (block.kind) this.atEnd("a '}'");
      return true;
    }
    if (!block.kind || this.token.kind !== "}") return false;
    this.open.pop();
    this.closed.set(block.kind, { label: block.label, line: this.take().line });
    return true;
  }

  /**
   * Return the number after a word; if there is none, 1.
   *
   * @param {Token} word
   * @returns {Token}
   */
  number(word) {
    const token = this.token;
    if (token.kind === "WORD") {
      const hint = this.hint(word, token);
      this.report(fill(texts.NOT_A_NUMBER, { word: word.text, found: token.text, hint }), locationOf(token));
      return { ...this.take(), kind: "NUMBER", text: "1" };
    }
    if (token.kind === "NUMBER" || token.kind === "END") return this.expect("NUMBER");
    const missing = COUNTS.get(word.text) ?? "a number";
    this.report(fill(texts.NEEDS, { word: word.text, wanted: missing }), locationOf(token));
    return { ...token, kind: "MISSING", text: "1" };
  }

  /**
   * Return the current token, which must be of this kind, and advance.
   *
   * @param {string} kind
   * @returns {Token}
   */
  expect(kind) {
    const token = this.token;
    const shown = WANTED.get(kind) ?? `'${kind}'`;
    const fits = token.kind === kind || (kind === "NAME" && (token.kind === "WORD" || token.kind === "STRING"));
    if (fits) return this.take();
    if (token.kind === "END") this.atEnd(shown);
    const message = fill(texts.EXPECTED, { wanted: shown, found: token.text });
    if (kind === "STRING" && token.kind === "WORD") {
      this.report(fill(texts.QUOTE_IT, { message }), locationOf(token));
      return { ...this.take(), kind: "STRING", text: '""' };
    }
    return this.stop(message, token);
  }

  // --- what does not fit it ---------------------------------------------------------------------------------------------

  /**
   * @param {string} missing
   * @returns {never}
   */
  atEnd(missing) {
    if (this.problems.length) throw new StopReading();
    const { kind, label, line } = this.open[this.open.length - 1];
    if (kind) this.stop(fill(texts.ENDS_INSIDE, { label, line }), this.token);
    return this.stop(fill(texts.ENDS_EARLY, { missing }), this.token);
  }

  /**
   * The likely meaning of a word where a number should be.
   *
   * @param {Token} word
   * @param {Token} token
   */
  hint(word, token) {
    if (word.text === "type") {
      const kinds = this.open.at(-1)?.kind === "constraint" ? loopKinds : jointTypes;
      return ` (${kinds.map((kind, i) => `${i} ${kind}`).join(", ")})`;
    }
    return NUMBER_WITH_UNIT.test(token.text) ? texts.HAS_UNIT : "";
  }

  /**
   * Report a token that doesn't belong in a block, with its likely meaning, and find where to go on.
   *
   * @param {Block} block
   * @param {Token} token
   */
  unfitting(block, token) {
    const word = token.text;
    const { kind, label } = block;
    const known = [...wordsOf(block).keys()];
    if (token.kind === "}") {
      const robot = this.closed.get("robot");
      this.stop(fill(texts.BRACE_TOO_MANY, { remedy: robot ? fill(texts.WAS_CLOSED, robot) : texts.REMOVE_IT }), token);
    }
    const homes = [...STATEMENTS].filter(([home, words]) => words.has(word) && home && home !== kind).map(([home]) => home);
    const outer = homes.filter((home) => this.closed.has(home));
    let message;
    if (token.kind !== "WORD") {
      const listed = known.map((one) => `'${one}'`).join(", ") || "'}'";
      message = fill(texts.UNEXPECTED, { found: word, label, listed });
    } else if (kind && STATEMENTS.get("")?.has(word)) {
      message = fill(texts.BELONGS_OUTSIDE, { word, label });
    } else if (outer.length && !this.open.some((one) => homes.includes(one.kind))) {
      this.outside(outer, token);
      this.reopen(known);
      return;
    } else if (kind === "parameters") {
      message = fill(texts.UNKNOWN_PARAMETER, { word, hint: didYouMean(word, known) });
    } else if (homes.length) {
      const listed = homes.map((home) => `'${home} { }'`).join(" or ");
      message = fill(texts.BELONGS_IN, { word, label, homes: listed });
    } else {
      message = fill(texts.UNKNOWN_WORD, { word, label, hint: didYouMean(word, known) });
    }
    this.report(message, locationOf(token));
    this.skip(token.line, known, kind !== "parameters");
  }

  /**
   * Report a word behind the end of its block.
   *
   * @param {string[]} outer kinds of blocks that were closed, to which it may belong
   * @param {Token} token
   */
  outside(outer, token) {
    const ended = (/** @type {string} */ one) => this.closed.get(one) ?? { label: "", line: 0 };
    const kind = outer.reduce((last, one) => (ended(one).line > ended(last).line ? one : last));
    const home = kind === "parameters" ? texts.A_PARAMETER_BLOCK : fill(texts.A_BLOCK, { kind });
    const closed = fill(texts.WAS_CLOSED, ended(kind));
    this.report(fill(texts.IS_OUTSIDE, { word: token.text, home, closed }), locationOf(token));
  }

  /**
   * Pass over what belongs to a stray word: a word after it on its line, its values, its block.
   *
   * @param {number} line
   * @param {string[]} known
   * @param {boolean} wordMayFollow
   */
  skip(line, known, wordMayFollow) {
    let depth = 0;
    while (this.token.kind !== "END") {
      const { kind, text } = this.token;
      if (kind === "}" && depth === 1) {
        this.take();
        return;
      }
      depth += Number(kind === "{") - Number(kind === "}" && depth > 0);
      const isName = wordMayFollow && kind === "WORD" && this.token.line === line && !known.includes(text);
      if (depth === 0 && !isName && !["NUMBER", "STRING", "(", ")"].includes(kind)) return;
      wordMayFollow = false;
      this.take();
    }
    throw new StopReading();
  }

  /**
   * Pass over the remainder of a block that was closed too early, its second closing brace included.
   *
   * @param {string[]} known
   */
  reopen(known) {
    let depth = 0;
    while (this.token.kind !== "END") {
      const { kind, text } = this.token;
      if (depth === 0 && kind === "WORD" && known.includes(text)) return;
      depth += Number(kind === "{") - Number(kind === "}");
      this.take();
      if (depth < 0) return;
    }
    throw new StopReading();
  }
}

/** @param {Block} block */
function wordsOf(block) {
  return STATEMENTS.get(block.kind) ?? new Map();
}

/**
 * White space in quotation marks, as Python writes it.
 *
 * @param {string} character
 */
function quoted(character) {
  const code = character.charCodeAt(0);
  const hex = code < 256 ? `x${code.toString(16).padStart(2, "0")}` : `u${code.toString(16).padStart(4, "0")}`;
  return `'\\${hex}'`;
}
