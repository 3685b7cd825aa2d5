// XML that is read as it comes, as `model.loading.threemf.xml` reads it: no tree, no document type. A
// worker has no DOMParser, which three.js's loaders of 3MF and AMF want.

import { SaxesParser, type SaxesTagNS } from "saxes";
import { MeshError } from "../mesh";
import { limit } from "./limits";
import { decoded, quoted } from "./text";

/** An element that begins. */
export interface Tag {
  name: string;
  namespace: string;
  /** An attribute by its name, and by its namespace, if it has one. */
  get(name: string, namespace?: string): string | undefined;
  /** The same; throws where there is none. */
  need(name: string): string;
}

const DEEPEST = 1000;

/** Call `onStart` for the start of every element, and `onEnd` for its end, with the text in it. Elements
 * and attributes are counted by a limit, except those of which `onStart` says that another counts them.
 * name: of the document, for messages. */
export function readXml(
  data: Uint8Array,
  name: string,
  onStart: (tag: Tag) => boolean | void,
  onEnd: (name: string, text: string) => void = () => {},
): void {
  const parser = new SaxesParser({ xmlns: true });
  const malformed = (why: string) =>
    new MeshError("bad-document", `the XML of ${quoted(name)} makes no sense: ${why}`);
  let [depth, values] = [0, 0];
  let text = "";
  parser.on("error", ({ message }) => {
    throw malformed(message);
  });
  parser.on("doctype", () => {
    throw new MeshError("bad-header", "a part of the package has a DTD, which 3MF forbids");
  });
  parser.on("opentag", (tag) => {
    if (++depth > DEEPEST) throw malformed(`elements are nested more than ${DEEPEST} deep`);
    text = "";
    if (onStart(new Started(tag, malformed))) return;
    values += 1 + Object.keys(tag.attributes).length;
    limit("values", values);
  });
  parser.on("text", (more) => (text += more));
  parser.on("closetag", ({ local }) => {
    depth--;
    onEnd(local, text.trim());
    text = "";
  });
  parser.write(decoded(data)).close();
}

class Started implements Tag {
  readonly name: string;
  readonly namespace: string;

  constructor(
    private readonly tag: SaxesTagNS,
    private readonly malformed: (why: string) => MeshError,
  ) {
    this.name = tag.local;
    this.namespace = tag.uri;
  }

  get(name: string, namespace?: string): string | undefined {
    const { attributes } = this.tag;
    if (namespace === undefined) return attributes[name]?.value;
    return Object.values(attributes).find((one) => one.local === name && one.uri === namespace)?.value;
  }

  need(name: string): string {
    const value = this.get(name);
    if (value === undefined) throw this.malformed(`an element has no attribute '${name}'`);
    return value;
  }
}

/** The number that a word is. */
export function numberOf(
  word: string,
  isRight: (value: number) => boolean = (value) => !Number.isNaN(value),
): number {
  const value = Number(word);
  if (word.trim() && isRight(value)) return value;
  throw new MeshError("bad-number", `${quoted(word)} stands where a number is expected`);
}

/** The whole number that a word is. */
export const wholeOf = (word: string) => numberOf(word, Number.isSafeInteger);
