// 3MF, without the DOM that three.js's loader wants and a worker has not: objects, components and
// build items of the package's model files.

import { strFromU8, unzipSync } from "fflate";
import { Matrix4, Vector3 } from "three";
import type { Soup } from "./soup";

interface Placed {
  key: string;
  matrix: Matrix4;
}

interface Thing {
  vertices: number[];
  triangles: number[];
  components: Placed[];
}

export function read3mf(data: ArrayBuffer): Soup {
  const files = unzipSync(new Uint8Array(data), { filter: (file) => /\.model$/i.test(file.name) });
  const things = new Map<string, Thing>();
  const items: Placed[] = [];
  for (const [name, bytes] of Object.entries(files)) {
    const text = strFromU8(bytes);
    const path = `/${name}`;
    for (const [, head, body] of text.matchAll(/<(?:\w+:)?object\b([^>]*)>([\s\S]*?)<\/(?:\w+:)?object>/g)) {
      things.set(`${path}#${attribute(head, "id")}`, readThing(body, path));
    }
    for (const [tag] of text.matchAll(/<(?:\w+:)?item\b[^>]*>/g)) items.push(placed(tag, path));
  }
  const positions: number[] = [];
  for (const item of items) addThing(things, item, new Matrix4(), positions, 0);
  return { positions: Float64Array.from(positions), colours: null };
}

function readThing(body: string, path: string): Thing {
  const numbers = (tag: string, names: string[]) =>
    [...body.matchAll(new RegExp(`<(?:\\w+:)?${tag}\\b[^>]*>`, "g"))].flatMap(([text]) =>
      names.map((name) => Number(attribute(text, name))),
    );
  return {
    vertices: numbers("vertex", ["x", "y", "z"]),
    triangles: numbers("triangle", ["v1", "v2", "v3"]),
    components: [...body.matchAll(/<(?:\w+:)?component\b[^>]*>/g)].map(([tag]) => placed(tag, path)),
  };
}

function placed(tag: string, path: string): Placed {
  const target = attribute(tag, "p:path") ?? path;
  const matrix = new Matrix4();
  const m = attribute(tag, "transform")?.trim().split(/\s+/).map(Number);
  if (m?.length === 12) {
    matrix.set(m[0], m[3], m[6], m[9], m[1], m[4], m[7], m[10], m[2], m[5], m[8], m[11], 0, 0, 0, 1);
  }
  return { key: `${target}#${attribute(tag, "objectid")}`, matrix };
}

function attribute(tag: string, name: string): string | undefined {
  return new RegExp(`(?:^|\\s)${name}\\s*=\\s*["']([^"']*)["']`).exec(tag)?.[1];
}

const DEEPEST = 32;

function addThing(
  things: Map<string, Thing>,
  item: Placed,
  above: Matrix4,
  positions: number[],
  depth: number,
): void {
  const thing = things.get(item.key);
  if (!thing || depth > DEEPEST) return;
  const matrix = above.clone().multiply(item.matrix);
  const corner = new Vector3();
  for (const vertex of thing.triangles) {
    corner.fromArray(thing.vertices, 3 * vertex).applyMatrix4(matrix);
    positions.push(corner.x, corner.y, corner.z);
  }
  for (const component of thing.components) {
    addThing(things, component, matrix, positions, depth + 1);
  }
}
