// Small still pictures of meshes, all from one renderer.

import type { Shown } from "./parsing";
import { Studio } from "./studio";

const SIZE = 160;

let studio: Studio | null | undefined;

/** A picture as a data URL, or null where there is no WebGL. */
export function thumbnail(shown: Shown, zUp: boolean): string | null {
  studio = studio === undefined ? opened() : studio;
  if (!studio) return null;
  studio.show(shown, zUp);
  studio.camera.position.setFromSpherical(studio.front());
  studio.camera.lookAt(0, 0, 0);
  studio.render();
  return studio.renderer.domElement.toDataURL();
}

function opened(): Studio | null {
  try {
    const made = new Studio();
    made.renderer.setSize(SIZE, SIZE, false);
    return made;
  } catch {
    return null;
  }
}
