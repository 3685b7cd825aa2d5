// Elements of records, as in PLY and OFF: from text or from bytes to numbers, as
// `model.loading.records` reads them.

import { MeshError } from "../mesh";
import { limit } from "./limits";
import { quoted, Words } from "./text";

/** How a number lies in bytes: integer with (i) or without sign (u), or float (f), and its bytes. */
export type Kind = "i1" | "u1" | "i2" | "u2" | "i4" | "u4" | "i8" | "u8" | "f4" | "f8";

export const sizeOf = (kind: Kind) => Number(kind[1]);

/** One field of a record: a number, or with `count` a list that is preceded by its length. */
export interface Field {
  name: string;
  item: Kind;
  count?: Kind;
}

/** `length` records of the same fields. */
export interface Element {
  name: string;
  length: number;
  fields: Field[];
}

/** What is wanted of an element: numbers of each record, in the order in which they are wanted, and
 * the items of one list, of which each record has `counts`. */
export interface Table {
  numbers: Float64Array;
  items: number[];
  counts: number[];
}

/** The names of numbers, and of one list at most, by the name of the element. */
export type Wanted = Record<string, string[]>;

/** Tables by the names of elements. note: what follows them, if it is more than padding. */
export interface Found {
  tables: Record<string, Table>;
  note: string;
}

/** Of numbers as text. Each record has a line, in which further words are passed over; or else all
 * words count, and lines do not. comments: whether # begins one. */
export function readText(
  text: string,
  place: number,
  elements: Element[],
  wanted: Wanted,
  comments = false,
): Found {
  const attempt = (lines: boolean): Found => {
    const source = new TextSource(new Words(text, place, comments), lines);
    const tables = readInTurn(source, elements, wanted);
    if (!lines && !source.words.isAtEnd) {
      throw new MeshError(
        "bad-face",
        "numbers are left over after the last face; write one vertex or face a line",
      );
    }
    return { tables, note: noteOfMore(text.slice(source.words.place).trim().length) };
  };
  const first = new Words(text, place, comments);
  const fields = elements.find(({ length }) => length)?.fields.length ?? 0;
  let count = first.isAtEnd || !first.next() ? 0 : 1;
  while (count && count < 3 && first.nextInLine()) count++;
  if (count < Math.min(fields, 3)) return attempt(false);
  try {
    return attempt(true);
  } catch (error) {
    try {
      return attempt(false);
    } catch {
      throw error;
    }
  }
}

/** Of numbers as bytes. */
export function readBytes(
  data: Uint8Array,
  place: number,
  littleEndian: boolean,
  elements: Element[],
  wanted: Wanted,
): Found {
  const source = new ByteSource(data, place, littleEndian);
  const tables = readInTurn(source, elements, wanted);
  let [start, end] = [source.place, data.length];
  const isPadding = (byte: number) => [0, 0x1a, 9, 10, 13, 32].includes(byte);
  while (end > start && isPadding(data[end - 1])) end--;
  while (end > start && isPadding(data[start])) start++;
  return { tables, note: noteOfMore(end - start) };
}

/** Records one number after another. */
interface Source {
  /** Whether records, of which each takes `least` bytes, or words, can be there. */
  holds(records: number, fields: Field[]): boolean;
  /** Begin a record of an element. Where the source ends within, all throw Ended. */
  begin(element: string): void;
  next(kind: Kind): number;
  skip(kind: Kind, count: number): void;
  end(): void;
}

class Ended extends Error {}

function readInTurn(source: Source, elements: Element[], wanted: Wanted): Record<string, Table> {
  const tables: Record<string, Table> = {};
  for (const element of elements) {
    if (Object.keys(wanted).every((name) => name in tables)) break;
    tables[element.name] = readElement(source, element, wanted[element.name] ?? []);
  }
  return tables;
}

function readElement(source: Source, element: Element, wanted: string[]): Table {
  const { name, length, fields } = element;
  if (fields.length && !source.holds(length, fields)) throw cutOff(element);
  if (name === "vertex") limit("vertices", length);
  if (name === "face") limit("faces", length);
  const columns = wanted.filter((one) => fields.some((field) => field.name === one && !field.count));
  const steps = fields.map((field) => ({
    ...field,
    column: columns.indexOf(field.name),
    isKept: field.count !== undefined && wanted.includes(field.name),
  }));
  const isWanted = ({ column, isKept }: (typeof steps)[0]) => column >= 0 || isKept;
  if (source instanceof TextSource && source.lines) {
    while (steps.length && !isWanted(steps.at(-1)!)) steps.pop();
  }
  const table: Table = { numbers: new Float64Array(length * columns.length), items: [], counts: [] };
  try {
    for (let record = 0; fields.length && record < length; record++) {
      source.begin(name);
      for (const { item, count, column, isKept } of steps) {
        if (!count) {
          if (column < 0) source.skip(item, 1);
          else table.numbers[record * columns.length + column] = source.next(item);
          continue;
        }
        const entries = source.next(count);
        if (!Number.isSafeInteger(entries) || entries < 0) {
          const what = `a list in the ${quoted(name)} records has a length that cannot be`;
          throw new MeshError("bad-face", `${what}; the file is damaged, export it again`);
        }
        if (isKept) {
          table.counts.push(entries);
          for (let entry = 0; entry < entries; entry++) table.items.push(source.next(item));
        } else source.skip(item, entries);
      }
      source.end();
    }
  } catch (error) {
    throw error instanceof Ended ? cutOff(element) : error;
  }
  return table;
}

const cutOff = ({ name, length }: Element) =>
  new MeshError(
    "truncated",
    `the file declares ${length} ${quoted(name)} records, but ends before the last; ` +
      "it is cut off, export or upload it again",
  );

const noteOfMore = (bytes: number) =>
  bytes
    ? `The file goes on for ${bytes} bytes after the records that its header declares: they were not read.`
    : "";

class TextSource implements Source {
  private element = "";

  constructor(
    readonly words: Words,
    readonly lines: boolean,
  ) {}

  holds(records: number, fields: Field[]): boolean {
    // A digit and white space for each field.
    return 2 * fields.length * records <= this.words.text.length - this.words.place + 1;
  }

  begin(element: string): void {
    this.element = element;
    if (this.words.isAtEnd) throw new Ended();
    this.words.toNext();
  }

  next(): number {
    return this.words.number(this.word());
  }

  skip(_: Kind, count: number): void {
    for (let i = 0; i < count; i++) this.word();
  }

  end(): void {
    if (this.lines) this.words.skipLine();
  }

  private word(): string {
    const word = this.lines ? this.words.nextInLine() : this.words.next();
    if (word) return word;
    if (!this.lines || this.words.isAtEnd) throw new Ended();
    throw new MeshError(
      ["vertex", "face"].includes(this.element) ? `bad-${this.element}` : "bad-record",
      `a ${quoted(this.element)} record has fewer numbers than it must have, in the line ${this.words.line}; ` +
        "the file is damaged, export it again",
    );
  }
}

class ByteSource implements Source {
  private readonly view: DataView;

  constructor(
    data: Uint8Array,
    public place: number,
    private readonly littleEndian: boolean,
  ) {
    this.view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  }

  holds(records: number, fields: Field[]): boolean {
    const least = fields.reduce((sum, { item, count }) => sum + sizeOf(count ?? item), 0);
    return least * records <= this.view.byteLength - this.place;
  }

  begin(): void {}

  next(kind: Kind): number {
    const { view, littleEndian: little } = this;
    const place = this.advance(sizeOf(kind));
    switch (kind) {
      case "i1":
        return view.getInt8(place);
      case "u1":
        return view.getUint8(place);
      case "i2":
        return view.getInt16(place, little);
      case "u2":
        return view.getUint16(place, little);
      case "i4":
        return view.getInt32(place, little);
      case "u4":
        return view.getUint32(place, little);
      case "i8":
        return Number(view.getBigInt64(place, little));
      case "u8":
        return Number(view.getBigUint64(place, little));
      case "f4":
        return view.getFloat32(place, little);
      case "f8":
        return view.getFloat64(place, little);
    }
  }

  skip(kind: Kind, count: number): void {
    this.advance(sizeOf(kind) * count);
  }

  end(): void {}

  private advance(bytes: number): number {
    const start = this.place;
    this.place += bytes;
    if (this.place > this.view.byteLength) throw new Ended();
    return start;
  }
}
