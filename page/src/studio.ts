// Where a mesh stands to be looked at: soft light from all around, and its shadow on the ground.

import {
  BufferAttribute,
  BufferGeometry,
  DirectionalLight,
  DoubleSide,
  Group,
  HemisphereLight,
  type Light,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
  PerspectiveCamera,
  Scene,
  Spherical,
  WebGLRenderer,
} from "three";
import { type Extent, FIELD_OF_VIEW, POLAR_ANGLE, distanceFor, extentOf } from "./framing";
import type { Shown } from "./parsing";
import { Shadow } from "./shadow";

const AZIMUTH = 0.6;

export class Studio {
  readonly camera = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.01, 50);
  readonly renderer: WebGLRenderer;
  extent: Extent = { height: 1, radius: 1 };
  private readonly scene = new Scene();
  private readonly shadow = new Shadow();
  private readonly mesh = new Group(); // with its shadow
  private readonly turned = new Group();
  private readonly geometry = new BufferGeometry();
  private readonly surface = new MeshStandardMaterial({
    roughness: 0.6,
    side: DoubleSide,
    polygonOffset: true, // behind its wires
    polygonOffsetFactor: 1,
    polygonOffsetUnits: 1,
  });
  private readonly wires: Mesh;

  /** Throws where there is no WebGL. */
  constructor(canvas?: HTMLCanvasElement) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: !canvas });
    const surface = new Mesh(this.geometry, this.surface);
    const wire = new MeshBasicMaterial({ color: 0x101828, wireframe: true, transparent: true, opacity: 0.35 });
    this.wires = new Mesh(this.geometry, wire);
    this.wires.visible = false;
    this.turned.add(surface, this.wires);
    this.mesh.add(this.turned, this.shadow);
    this.clear();
    this.scene.add(this.mesh, ...lights());
  }

  get shows(): boolean {
    return this.mesh.visible;
  }

  set wireframe(on: boolean) {
    this.wires.visible = on;
  }

  show(shown: Shown, zUp: boolean): void {
    this.geometry.dispose();
    this.geometry.deleteAttribute("color");
    this.geometry.setAttribute("position", new BufferAttribute(shown.positions, 3));
    this.geometry.setAttribute("normal", new BufferAttribute(shown.normals, 3));
    if (shown.colours) this.geometry.setAttribute("color", new BufferAttribute(shown.colours, 3));
    this.geometry.computeBoundingSphere();
    this.surface.vertexColors = shown.colours !== null;
    this.surface.color.set(shown.colours ? 0xffffff : 0x9fb2cf);
    this.surface.needsUpdate = true;
    this.turned.rotation.x = zUp ? -Math.PI / 2 : 0;
    this.mesh.visible = true;
    this.extent = extentOf(shown, zUp);
    this.shadow.fall(shown.positions, zUp, this.extent.height);
  }

  clear(): void {
    this.mesh.visible = false;
  }

  /** From where the mesh is seen at first. */
  front(): Spherical {
    return new Spherical(distanceFor(this.extent, this.camera.aspect), POLAR_ANGLE, AZIMUTH);
  }

  render(): void {
    this.renderer.render(this.scene, this.camera);
  }
}

/** Bright from above, darker from below; from the front left, and along the edges from behind. */
function lights(): Light[] {
  const above = new DirectionalLight(0xffffff, 0.6);
  above.position.set(0.4, 3, 0.4);
  const front = new DirectionalLight(0xfff6ea, 1.5);
  front.position.set(-0.4, 1, 2);
  const behind = new DirectionalLight(0xdfeaff, 0.9);
  behind.position.set(1, 0.6, -2);
  return [new HemisphereLight(0xffffff, 0x6f7b8c, 1.5), above, front, behind];
}
