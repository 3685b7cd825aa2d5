// From the bytes of a file to what the view draws.

import { load } from "../loading";
import { type Pieces, readGltf } from "../loading/gltf";
import { normalsOf } from "./normals";
import { reduced } from "./reduce";
import { soupOf } from "./soup";

/** A mesh to show: centred, of radius 1. positions and normals: 9 numbers a face; colours: the same,
 * or none. faces: how many the file has, of which `positions` may hold fewer. */
export interface Shown {
  positions: Float32Array;
  normals: Float32Array;
  colours: Float32Array | null;
  faces: number;
}

/** pieces: files that it refers to. coloured: show the colours of a GLB, which it has. Throws for
 * what cannot be shown. */
export async function read(
  name: string,
  data: ArrayBuffer,
  pieces: Pieces,
  coloured: boolean,
): Promise<Shown> {
  const mesh = coloured ? readGltf(new Uint8Array(data), pieces, true) : await load(name, data, pieces);
  const soup = soupOf(mesh);
  const faces = soup.positions.length / 9;
  if (!faces || !soup.positions.every(Number.isFinite)) throw new Error("nothing to show");
  const few = reduced(soup);
  const positions = centred(soup.positions, few.positions);
  return {
    positions,
    normals: normalsOf(positions),
    colours: few.colours && perCorner(few.colours),
    faces,
  };
}

/** `shown` as seen from the middle of `whole`, so that both forms of a mesh lie alike. */
function centred(whole: Float64Array, shown: Float64Array): Float32Array {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < whole.length; i++) {
    const k = i % 3;
    if (whole[i] < low[k]) low[k] = whole[i];
    if (whole[i] > high[k]) high[k] = whole[i];
  }
  const middle = low.map((value, k) => (value + high[k]) / 2);
  const radius = Math.hypot(...high.map((value, k) => value - middle[k])) || 1;
  const result = new Float32Array(shown.length);
  for (let i = 0; i < shown.length; i++) result[i] = (shown[i] - middle[i % 3]) / radius;
  return result;
}

function perCorner(colours: Float32Array): Float32Array {
  const corners = new Float32Array(3 * colours.length);
  for (let i = 0; i < corners.length; i++) corners[i] = colours[3 * Math.floor(i / 9) + (i % 3)];
  return corners;
}
