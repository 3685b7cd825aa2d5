// Text of a file, its words and numbers, as `model.loading.text` reads them.

import { MeshError } from "../mesh";

const SHOWN = 60; // characters of a file's content in a message

/** The text of bytes in UTF-8 without padding, in which lines end in a line feed. */
export function textOf(data: Uint8Array): string {
  let end = data.length;
  if (data[end - 1] === 0 || data[end - 1] === 0x1a) {
    while (end && (data[end - 1] === 0 || data[end - 1] === 0x1a || isSpace(data[end - 1]))) end--;
  }
  const text = decoded(data.subarray(0, end));
  const zero = text.indexOf("\0");
  if (zero >= 0) {
    throw new MeshError(
      "not-text",
      `byte ${zero} is zero, which no text holds; the file is damaged or of another format`,
    );
  }
  return `${text.includes("\r") ? text.replace(/\r\n?/g, "\n") : text}\n`;
}

/** Whether bytes are text in UTF-16 with a mark that says so. */
export const isWide = (data: Uint8Array) => ["255,254", "254,255"].includes(data.subarray(0, 2).join());

/** Text without byte-order mark, in UTF-16 where that says so. Else names may be in any encoding: they
 * are not used. */
export const decoded = (data: Uint8Array) =>
  new TextDecoder(isWide(data) ? (data[0] === 0xff ? "utf-16le" : "utf-16be") : "utf-8").decode(data);

const isSpace = (code: number) => code === 32 || (code >= 9 && code <= 13);

/** Content of a file for a message: quoted and shortened. */
export const quoted = (content: string) =>
  content.length > SHOWN ? `'${content.slice(0, SHOWN)}'…` : `'${content}'`;

/** The words of a text one after another, from `place` on; "" at its end. */
export class Words {
  /** comments: whether # begins one, before a word. */
  constructor(
    readonly text: string,
    public place = 0,
    private readonly comments = false,
  ) {}

  next(): string {
    const { text } = this;
    const start = this.start();
    let end = start;
    while (end < text.length && !isSpace(text.charCodeAt(end))) end++;
    this.place = end;
    return text.slice(start, end);
  }

  /** The next word of the line; "" at the end of the line. */
  nextInLine(): string {
    const { text } = this;
    let start = this.place;
    while (start < text.length && text[start] !== "\n" && isSpace(text.charCodeAt(start))) start++;
    this.place = start;
    return text[start] === "\n" || (this.comments && text[start] === "#") ? "" : this.next();
  }

  /** Go to the next word. */
  toNext(): void {
    this.place = this.start();
  }

  skipLine(): void {
    const end = this.text.indexOf("\n", this.place);
    this.place = end < 0 ? this.text.length : end + 1;
  }

  /** Whether there are no more words. */
  get isAtEnd(): boolean {
    return this.start() >= this.text.length;
  }

  /** The line around the place, for a message. */
  get line(): string {
    const start = this.text.lastIndexOf("\n", Math.max(this.place - 1, 0)) + 1;
    return quoted(this.text.slice(start, this.text.indexOf("\n", start)).trim());
  }

  /** The number that a word is. */
  number(word: string): number {
    const value = Number(word);
    if (!Number.isNaN(value) || /^[+-]?nan$/i.test(word)) return value;
    const infinite = /^([+-]?)inf(?:inity)?$/i.exec(word);
    if (infinite) return infinite[1] === "-" ? -Infinity : Infinity;
    throw new MeshError(
      "bad-number",
      `${quoted(word)} stands where a number is expected, in the line ${this.line}`,
    );
  }

  private start(): number {
    const { text } = this;
    let start = this.place;
    for (;;) {
      while (start < text.length && isSpace(text.charCodeAt(start))) start++;
      if (!this.comments || text[start] !== "#") return start;
      start = text.indexOf("\n", start);
      if (start < 0) return text.length;
    }
  }
}
