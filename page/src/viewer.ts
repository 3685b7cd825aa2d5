// The mesh in 3D. It draws only when something moves.

import {
  BufferAttribute,
  BufferGeometry,
  DirectionalLight,
  DoubleSide,
  Group,
  HemisphereLight,
  Mesh,
  MeshStandardMaterial,
  PerspectiveCamera,
  Scene,
  Spherical,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { type Extent, FIELD_OF_VIEW, POLAR_ANGLE, distanceFor, extentOf } from "./framing";
import type { Shown } from "./parsing";

const AZIMUTH = 0.6;
const NEAREST = 0.8;
const FARTHEST = 12;
const TURN = 0.15;
const ZOOM = 1.12;

export function geometryOf(shown: Shown): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(shown.positions, 3));
  if (shown.colours) geometry.setAttribute("color", new BufferAttribute(shown.colours, 3));
  return geometry;
}

export function materialFor(coloured: boolean): MeshStandardMaterial {
  return new MeshStandardMaterial({
    color: coloured ? 0xffffff : 0xb9c4d6,
    vertexColors: coloured,
    flatShading: true,
    metalness: 0,
    roughness: coloured ? 1 : 0.75,
    side: DoubleSide,
  });
}

const startFrom = (distance: number) => new Spherical(distance, POLAR_ANGLE, AZIMUTH);

/** A camera that looks at the origin, with lights that go where it goes. */
export function cameraWithLights(distance: number): PerspectiveCamera {
  const camera = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.01, 50);
  camera.position.setFromSpherical(startFrom(distance));
  camera.lookAt(0, 0, 0);
  const key = new DirectionalLight(0xffffff, 1.9);
  key.position.set(-0.6, 1, 1);
  const fill = new DirectionalLight(0xffffff, 0.7);
  fill.position.set(1, -0.3, 0.6);
  camera.add(key, fill);
  return camera;
}

export function sceneWith(camera: PerspectiveCamera): Scene {
  const scene = new Scene();
  scene.add(new HemisphereLight(0xffffff, 0x8a8f9c, 1.25), camera);
  return scene;
}

export class Viewer {
  private readonly renderer: WebGLRenderer;
  private readonly camera = cameraWithLights(3);
  private readonly scene = sceneWith(this.camera);
  private readonly holder = new Group();
  private readonly controls: OrbitControls;
  private mesh: Mesh<BufferGeometry, MeshStandardMaterial> | null = null;
  private extent: Extent | null = null;
  private asked = false;
  private drawnAt = 0;

  /** Throws where there is no WebGL. */
  constructor(private readonly canvas: HTMLCanvasElement) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.scene.add(this.holder);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = true;
    this.controls.enablePan = false;
    this.controls.minDistance = NEAREST;
    this.controls.maxDistance = FARTHEST;
    this.controls.autoRotateSpeed = 1.6;
    this.controls.addEventListener("change", () => this.draw());
    this.controls.addEventListener("start", () => this.onTouched());
    canvas.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement!);
  }

  /** Called when somebody takes the mesh in hand. */
  onTouched: () => void = () => {};

  show(shown: Shown, zUp: boolean): void {
    this.clear();
    this.mesh = new Mesh(geometryOf(shown), materialFor(shown.colours !== null));
    this.mesh.rotation.x = zUp ? -Math.PI / 2 : 0;
    this.holder.add(this.mesh);
    this.resize();
    this.frame(extentOf(shown, zUp));
  }

  clear(): void {
    if (!this.mesh) return;
    this.holder.remove(this.mesh);
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
    this.mesh = null;
    this.draw();
  }

  reset(): void {
    this.place(startFrom(this.distance()));
  }

  set spinning(on: boolean) {
    this.controls.autoRotate = on;
    this.draw();
  }

  private key(event: KeyboardEvent): void {
    const place = new Spherical().setFromVector3(this.camera.position);
    const moves: Record<string, () => void> = {
      ArrowLeft: () => (place.theta -= TURN),
      ArrowRight: () => (place.theta += TURN),
      ArrowUp: () => (place.phi -= TURN),
      ArrowDown: () => (place.phi += TURN),
      "+": () => (place.radius /= ZOOM),
      "=": () => (place.radius /= ZOOM),
      "-": () => (place.radius *= ZOOM),
      Home: () => place.copy(startFrom(this.distance())),
    };
    const move = moves[event.key];
    if (!move || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    this.onTouched();
    move();
    place.radius = Math.min(Math.max(place.radius, NEAREST), FARTHEST);
    this.place(place.makeSafe());
  }

  /** Go as near as the mesh allows, unless it reaches as far as the one before. */
  private frame(extent: Extent): void {
    const before = this.extent;
    this.extent = extent;
    const alike = (a: number, b: number) => Math.abs(a - b) < 0.01;
    if (before && alike(before.height, extent.height) && alike(before.radius, extent.radius)) return;
    const place = new Spherical().setFromVector3(this.camera.position);
    place.radius = this.distance();
    this.place(place);
  }

  private distance(): number {
    return this.extent ? distanceFor(this.extent, this.camera.aspect) : 3;
  }

  /** Put the camera somewhere, and end what still moves it after a drag. */
  private place(where: Spherical): void {
    this.controls.enableDamping = false;
    this.controls.update();
    this.controls.enableDamping = true;
    this.camera.position.setFromSpherical(where);
    this.controls.update();
    this.draw();
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement!;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  private draw(): void {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame((now) => {
      this.asked = false;
      // At the same speed however slow the frames are, and without a leap after a pause.
      this.controls.update(Math.min((now - this.drawnAt) / 1000, 0.1));
      this.drawnAt = now;
      this.renderer.render(this.scene, this.camera);
      // Damping asks for further frames by itself, as long as it moves the camera.
      if (this.controls.autoRotate && this.mesh) this.draw();
    });
  }
}
