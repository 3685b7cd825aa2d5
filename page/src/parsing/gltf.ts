// glTF through three.js's loader, without materials and images: they are not shown, and would
// have to be fetched.

import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { soupOf, type Soup } from "./soup";

interface Document {
  meshes?: { primitives: { material?: number }[] }[];
  [part: string]: unknown;
}

const JSON_CHUNK = 0x4e4f534a;

export async function readGltf(data: ArrayBuffer): Promise<Soup> {
  const { scene } = await new GLTFLoader().parseAsync(bare(data), "");
  return soupOf(scene);
}

function bare(data: ArrayBuffer): ArrayBuffer | string {
  const view = new DataView(data);
  const binary = view.getUint32(0, true) === 0x46546c67;
  if (!binary) return strip(new TextDecoder().decode(data));
  const length = view.getUint32(12, true);
  if (view.getUint32(16, true) !== JSON_CHUNK) return data;
  const text = strip(new TextDecoder().decode(new Uint8Array(data, 20, length)));
  const json = new TextEncoder().encode(text);
  const padded = new Uint8Array(4 * Math.ceil(json.length / 4)).fill(32);
  padded.set(json);
  const rest = new Uint8Array(data, 20 + length);
  const result = new Uint8Array(20 + padded.length + rest.length);
  result.set(new Uint8Array(data, 0, 20));
  result.set(padded, 20);
  result.set(rest, 20 + padded.length);
  const head = new DataView(result.buffer);
  head.setUint32(8, result.length, true);
  head.setUint32(12, padded.length, true);
  return result.buffer;
}

function strip(text: string): string {
  const document = JSON.parse(text) as Document;
  for (const part of ["materials", "textures", "images", "samplers", "animations", "skins"]) {
    delete document[part];
  }
  for (const mesh of document.meshes ?? []) {
    for (const primitive of mesh.primitives) delete primitive.material;
  }
  for (const node of (document.nodes ?? []) as { skin?: number }[]) delete node.skin;
  return JSON.stringify(document);
}
