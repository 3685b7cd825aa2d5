// From how far a mesh fills the picture, however it is turned about its upright axis.

import type { Shown } from "./parsing";

/** Of the camera, in degrees from top to bottom. */
export const FIELD_OF_VIEW = 30;
/** From the upright axis, as it looks down a little; in radians. */
export const POLAR_ANGLE = 1.25;
// Around the mesh, as a share of its size.
const MARGIN = 0.05;

/** How far a mesh reaches: from its middle upwards, and from its upright axis. */
export interface Extent {
  height: number;
  radius: number;
}

export function extentOf({ positions }: Shown, zUp: boolean): Extent {
  const [up, side] = zUp ? [2, 1] : [1, 2];
  let height = 0;
  let squared = 0;
  for (let i = 0; i < positions.length; i += 3) {
    height = Math.max(height, Math.abs(positions[i + up]));
    squared = Math.max(squared, positions[i] ** 2 + positions[i + side] ** 2);
  }
  return { height, radius: Math.sqrt(squared) };
}

/** Distance of the camera from which the cylinder around a mesh is in view. aspect: width over
 * height of the picture. */
export function distanceFor({ height, radius }: Extent, aspect: number): number {
  const slope = Math.tan((FIELD_OF_VIEW * Math.PI) / 360) / (1 + MARGIN);
  const [sin, cos] = [Math.sin(POLAR_ANGLE), Math.cos(POLAR_ANGLE)];
  // The rim's farthest points above and below, and to the side; what is nearer looks larger.
  const below = (height * sin + radius * cos) / slope + radius * sin - height * cos;
  const above = (height * sin + radius * cos) / slope - radius * sin + height * cos;
  const beside = radius * Math.hypot(1 / (slope * aspect), sin) + height * cos;
  return Math.max(below, above, beside);
}
