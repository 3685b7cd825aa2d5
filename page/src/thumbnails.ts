// Small still pictures of meshes, all from one renderer.

import { Mesh, WebGLRenderer } from "three";
import { distanceFor, extentOf } from "./framing";
import type { Shown } from "./parsing";
import { cameraWithLights, geometryOf, materialFor, sceneWith } from "./viewer";

const SIZE = 160;

let renderer: WebGLRenderer | null | undefined;

/** A picture as a data URL, or null where there is no WebGL. */
export function thumbnail(shown: Shown, zUp: boolean): string | null {
  if (renderer === undefined) {
    try {
      renderer = new WebGLRenderer({ antialias: true, alpha: true, preserveDrawingBuffer: true });
      renderer.setSize(SIZE, SIZE, false);
    } catch {
      renderer = null;
    }
  }
  if (!renderer) return null;
  const camera = cameraWithLights(distanceFor(extentOf(shown, zUp), 1));
  const scene = sceneWith(camera);
  const mesh = new Mesh(geometryOf(shown), materialFor(shown.colours !== null));
  mesh.rotation.x = zUp ? -Math.PI / 2 : 0;
  scene.add(mesh);
  renderer.render(scene, camera);
  mesh.geometry.dispose();
  mesh.material.dispose();
  return renderer.domElement.toDataURL();
}
