// The shadow of a mesh on the ground, as soft as under an overcast sky: dark where it is near. It is
// found from points of the surface, once for a mesh, and costs no drawing.

import { DataTexture, LinearFilter, Mesh, MeshBasicMaterial, PlaneGeometry } from "three";
import { pointsOn } from "./points";

const POINTS = 20_000;
const CELLS = 96;
/** Of the ground that can be dark; meshes have a radius of 1. */
const SIDE = 3;
const DARKEST = 130;
// The height above which little shadow is left.
const HIGH = 0.3;
// Cells over which it is smeared, three times.
const SOFT = 4;

export class Shadow extends Mesh<PlaneGeometry, MeshBasicMaterial> {
  private readonly texture = new DataTexture(new Uint8Array(4 * CELLS * CELLS), CELLS, CELLS);

  constructor() {
    super(new PlaneGeometry(SIDE, SIDE), new MeshBasicMaterial({ transparent: true, depthWrite: false }));
    this.texture.magFilter = LinearFilter;
    this.material.map = this.texture;
    this.rotation.x = -Math.PI / 2;
  }

  /** Fall from a mesh whose lowest point is `height` below its middle. */
  fall(positions: Float32Array, zUp: boolean, height: number): void {
    this.position.y = -height;
    let dark = new Float32Array(CELLS * CELLS);
    const points = pointsOn(positions, POINTS);
    const cell = (value: number) => Math.floor((value / SIDE + 0.5) * CELLS);
    for (let i = 0; i < points.length; i += 3) {
      const [x, y, z] = points.subarray(i, i + 3);
      const [up, back] = zUp ? [z, y] : [y, -z];
      const place = cell(back) * CELLS + cell(x);
      dark[place] = Math.max(dark[place], Math.exp(-(up + height) / HIGH));
    }
    for (let i = 0; i < 3; i++) dark = smeared(smeared(dark, 1, CELLS), CELLS, 1);
    dark.forEach((value, i) => (this.texture.image.data![4 * i + 3] = DARKEST * value));
    this.texture.needsUpdate = true;
  }
}

/** Each cell as the mean of those around it in a line. step, across: to the next cell of a line, and
 * to the next line. */
function smeared(cells: Float32Array, step: number, across: number): Float32Array<ArrayBuffer> {
  const result = new Float32Array(cells.length);
  for (let line = 0; line < CELLS; line++) {
    for (let i = SOFT; i < CELLS - SOFT; i++) {
      let sum = 0;
      for (let k = -SOFT; k <= SOFT; k++) sum += cells[line * across + (i + k) * step];
      result[line * across + i * step] = sum / (2 * SOFT + 1);
    }
  }
  return result;
}
