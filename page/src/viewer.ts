// The mesh in 3D. It draws only when something moves.

import { Spherical } from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Shown } from "./parsing";
import { Studio } from "./studio";

const NEAREST = 0.8;
const FARTHEST = 12;
const TURN = 0.15;
const ZOOM = 1.12;

export class Viewer {
  private readonly studio: Studio;
  private readonly controls: OrbitControls;
  private asked = false;
  private drawnAt = 0;

  /** Throws where there is no WebGL. */
  constructor(private readonly canvas: HTMLCanvasElement) {
    this.studio = new Studio(canvas);
    this.studio.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.controls = new OrbitControls(this.studio.camera, canvas);
    this.controls.enableDamping = true;
    this.controls.enablePan = false;
    this.controls.minDistance = NEAREST;
    this.controls.maxDistance = FARTHEST;
    this.controls.autoRotateSpeed = 1.6;
    this.controls.addEventListener("change", () => this.draw());
    this.controls.addEventListener("start", () => this.onTouched());
    canvas.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement!);
    this.reset();
  }

  /** Called when somebody takes the mesh in hand. */
  onTouched: () => void = () => {};

  show(shown: Shown, zUp: boolean): void {
    const before = this.studio.extent;
    this.studio.show(shown, zUp);
    const { extent } = this.studio;
    const alike = (a: number, b: number) => Math.abs(a - b) < 0.01;
    if (!alike(before.height, extent.height) || !alike(before.radius, extent.radius)) this.frame();
    this.draw();
  }

  clear(): void {
    this.studio.clear();
    this.draw();
  }

  reset(): void {
    this.place(this.studio.front());
  }

  set spinning(on: boolean) {
    this.controls.autoRotate = on;
    this.draw();
  }

  set wireframe(on: boolean) {
    this.studio.wireframe = on;
    this.draw();
  }

  private key(event: KeyboardEvent): void {
    const place = this.where();
    const moves: Record<string, () => void> = {
      ArrowLeft: () => (place.theta -= TURN),
      ArrowRight: () => (place.theta += TURN),
      ArrowUp: () => (place.phi -= TURN),
      ArrowDown: () => (place.phi += TURN),
      "+": () => (place.radius /= ZOOM),
      "=": () => (place.radius /= ZOOM),
      "-": () => (place.radius *= ZOOM),
      Home: () => place.copy(this.studio.front()),
    };
    const move = moves[event.key];
    if (!move || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    this.onTouched();
    move();
    place.radius = Math.min(Math.max(place.radius, NEAREST), FARTHEST);
    this.place(place.makeSafe());
  }

  private where(): Spherical {
    return new Spherical().setFromVector3(this.studio.camera.position);
  }

  /** Go as near as the mesh allows, from the same side. */
  private frame(): void {
    const place = this.where();
    place.radius = this.studio.front().radius;
    this.place(place);
  }

  /** Put the camera somewhere, and end what still moves it after a drag. */
  private place(where: Spherical): void {
    this.controls.enableDamping = false;
    this.controls.update();
    this.controls.enableDamping = true;
    this.studio.camera.position.setFromSpherical(where);
    this.controls.update();
    this.draw();
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement!;
    const { camera, renderer } = this.studio;
    if (!width || !height) return;
    const framed = Math.abs(this.where().radius - this.studio.front().radius) < 0.01;
    renderer.setSize(width, height, false);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    if (framed) this.frame();
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
      this.studio.render();
      // Damping asks for further frames by itself, as long as it moves the camera.
      if (this.controls.autoRotate && this.studio.shows) this.draw();
    });
  }
}
