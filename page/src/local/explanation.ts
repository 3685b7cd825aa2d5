// An explained file, as coloured GLB and PLY and as JSON: those of `service.attribution`.

import type { Answer, Form } from "../api";
import type { Legend } from "../entries";
import type { Mesh } from "../mesh";
import { legendColours, linearColour, srgbColour } from "./colours";

export interface Explanation {
  answer: Answer;
  class: string;
  score: number;
  bias: number;
  limit: number;
  mesh: Mesh;
  contributions: Float64Array;
  densities: Float64Array;
}

// Codes of glTF.
const FLOAT = 5126;
const UNSIGNED_SHORT = 5123;
const ARRAY_BUFFER = 34962;

export function written(explanation: Explanation, form: Form): BlobPart[] {
  if (form === "glb") return glb(explanation);
  return form === "ply" ? ply(explanation) : [json(explanation)];
}

function legend({ answer, class: label, score, bias, limit }: Explanation): Legend {
  const { file, model } = answer;
  return { file, class: label, score, bias, limit, colours: legendColours(), model };
}

function json(explanation: Explanation): string {
  const { answer, contributions, densities } = explanation;
  const numbers = { contributions: [...contributions], densities: [...densities] };
  return JSON.stringify({ ...answer, evidence: { ...legend(explanation), ...numbers } });
}

/** No two faces share a vertex, so that each keeps its colour to its edges. */
function glb(explanation: Explanation): BlobPart[] {
  const { mesh, densities, limit } = explanation;
  const { vertices, faces } = mesh;
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (const v of faces) {
    for (let k = 0; k < 3; k++) {
      low[k] = Math.min(low[k], vertices[3 * v + k]);
      high[k] = Math.max(high[k], vertices[3 * v + k]);
    }
  }
  // The file's origin may be so far away that single precision could not tell the corners apart.
  const origin = low.map((value, k) => (value + high[k]) / 2);
  const positions = new Float32Array(3 * faces.length);
  const colours = new Uint16Array(4 * faces.length);
  for (let h = 0; h < faces.length; h++) {
    for (let k = 0; k < 3; k++) positions[3 * h + k] = vertices[3 * faces[h] + k] - origin[k];
  }
  densities.forEach((density, f) => {
    const colour = [...linearColour(density / (limit || 1)), 1].map((c) => Math.round(65535 * c));
    for (let s = 0; s < 3; s++) colours.set(colour, 4 * (3 * f + s));
  });
  const title = `evidence for ${explanation.class}`;
  const document = {
    asset: { version: "2.0", generator: "meshconv3d" },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0, name: title, translation: origin, extras: legend(explanation) }],
    meshes: [{ name: title, primitives: [{ attributes: { POSITION: 0, COLOR_0: 1 }, material: 0 }] }],
    materials: [
      {
        name: "evidence",
        doubleSided: true,
        pbrMetallicRoughness: { metallicFactor: 0, roughnessFactor: 1 },
      },
    ],
    accessors: [
      {
        bufferView: 0,
        componentType: FLOAT,
        count: faces.length,
        type: "VEC3",
        min: low.map((value, k) => Math.fround(value - origin[k])),
        max: high.map((value, k) => Math.fround(value - origin[k])),
      },
      {
        bufferView: 1,
        componentType: UNSIGNED_SHORT,
        normalized: true,
        count: faces.length,
        type: "VEC4",
      },
    ],
    bufferViews: [view(0, positions.byteLength), view(positions.byteLength, colours.byteLength)],
    buffers: [{ byteLength: positions.byteLength + colours.byteLength }],
  };
  const text = new TextEncoder().encode(JSON.stringify(document));
  const padding = new Uint8Array((4 - (text.length % 4)) % 4).fill(32);
  const head = text.length + padding.length;
  const binary = positions.byteLength + colours.byteLength; // 12 and 8 bytes each: a multiple of 4
  const [JSON_CHUNK, BINARY_CHUNK] = [0x4e4f534a, 0x004e4942];
  return [
    Uint32Array.of(0x46546c67, 2, 28 + head + binary, head, JSON_CHUNK),
    text,
    padding,
    Uint32Array.of(binary, BINARY_CHUNK),
    positions,
    colours,
  ];
}

const view = (byteOffset: number, byteLength: number) => ({
  buffer: 0,
  byteOffset,
  byteLength,
  target: ARRAY_BUFFER,
});

function ply(explanation: Explanation): BlobPart[] {
  const { mesh, contributions, densities, limit } = explanation;
  const { vertices, faces } = mesh;
  const [CORNER, FACE] = [27, 29]; // bytes of each
  const body = new DataView(new ArrayBuffer(CORNER * faces.length + (FACE * faces.length) / 3));
  for (let h = 0; h < faces.length; h++) {
    const at = CORNER * h;
    for (let k = 0; k < 3; k++) body.setFloat64(at + 8 * k, vertices[3 * faces[h] + k], true);
    if (h % 3) continue;
    const colour = srgbColour(densities[h / 3] / (limit || 1));
    for (let s = 0; s < 3; s++) colour.forEach((byte, k) => body.setUint8(at + CORNER * s + 24 + k, byte));
  }
  densities.forEach((density, f) => {
    const at = CORNER * faces.length + FACE * f;
    body.setUint8(at, 3);
    for (let s = 0; s < 3; s++) body.setInt32(at + 1 + 4 * s, 3 * f + s, true);
    body.setFloat64(at + 13, contributions[f], true);
    body.setFloat64(at + 21, density, true);
  });
  const header = [
    "ply",
    "format binary_little_endian 1.0",
    `comment ${JSON.stringify(legend(explanation))}`,
    `element vertex ${faces.length}`,
    ...["x", "y", "z"].map((axis) => `property double ${axis}`),
    ...["red", "green", "blue"].map((colour) => `property uchar ${colour}`),
    `element face ${faces.length / 3}`,
    "property list uchar int vertex_indices",
    "property double contribution",
    "property double density",
    "end_header\n",
  ];
  return [header.join("\n"), body.buffer];
}
