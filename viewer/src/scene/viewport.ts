// Renderer, camera, light, and a loop that draws only when something changed.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

import { centreAcross, fitDistance, freeRegion } from "./framing";
import type { Region } from "./framing";
import type { SceneMessage } from "../net/protocol";

const FIELD_OF_VIEW_DEG = 35;
/** Device pixels beyond these cost time and are hardly seen. */
const PIXEL_RATIO_MAX = 2;
const PIXELS_MAX = 4e6;
/** Drivers that compute every sample on the processor, where smoothing edges would halve the frame rate. */
const SOFTWARE_DRIVER = /swiftshader|llvmpipe|softpipe|software/i;
/** From the front, a little to the right and above; z is up. */
const DEFAULT_DIRECTION = new THREE.Vector3(0.45, -1, 0.62).normalize();

export class Viewport {
  readonly scene = new THREE.Scene();
  readonly camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, 0.001, 10);
  readonly controls: OrbitControls;
  private readonly renderer: THREE.WebGLRenderer;
  private readonly viewListeners: (() => void)[] = [];
  private dirty = true;
  private framed: { points: Float32Array; scene: SceneMessage } | null = null;
  private region: Region = { left: 0, top: 0, width: 1, height: 1 };
  /** Of the picture that the region is a part of, CSS pixels. */
  private pictureHeight = 1;

  /** Bodies are framed beside the overlays; beforeDraw takes in what has arrived and returns whether that changed the picture; afterDraw runs when it is shown. */
  constructor(
    readonly canvas: HTMLCanvasElement,
    private readonly overlays: HTMLElement[],
    private readonly beforeDraw: () => boolean,
    private readonly afterDraw: () => void,
  ) {
    // The page's style draws the backdrop behind a transparent canvas: that is cheaper than filling it here.
    this.renderer = new THREE.WebGLRenderer({ canvas, alpha: true, antialias: !drawsInSoftware() });
    this.camera.up.set(0, 0, 1);
    this.addLights();
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.mouseButtons = { LEFT: THREE.MOUSE.ROTATE, MIDDLE: THREE.MOUSE.PAN, RIGHT: THREE.MOUSE.ROTATE };
    // One finger presses wherever it meets a body, so two must do for all of the rest, but for moving: three do that.
    this.controls.touches = { ONE: THREE.TOUCH.ROTATE, TWO: THREE.TOUCH.DOLLY_ROTATE };
    this.controls.addEventListener("change", () => this.changeView());
    // A driver may take the context away and give it back; what it showed is gone.
    canvas.addEventListener("webglcontextrestored", () => this.invalidate());
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement!);
    this.resize();
    this.renderer.setAnimationLoop(() => this.tick());
  }

  invalidate(): void {
    this.dirty = true;
  }

  /**
   * Looks at points of a scene: from its view if it has one, else along a direction towards the viewer, and never closer than
   * where all of them are seen.
   */
  frame(points: Float32Array, scene: SceneMessage, direction = DEFAULT_DIRECTION): void {
    const { size, view } = scene;
    this.framed = { points, scene };
    this.centreInFreeRegion();
    const centre = new THREE.Box3().setFromArray(points).getCenter(new THREE.Vector3());
    const target = view ? new THREE.Vector3(...view.target) : centre;
    const offset = view ? new THREE.Vector3(...view.position).sub(target) : direction.clone();
    const wanted = view ? offset.length() : 0;
    offset.normalize();
    if (!view) {
      // The middle of the bounds is not that of the picture: nearer parts look larger. Twice is close enough.
      for (let i = 0; i < 2; i++) centreAcross(points, target, offset, this.camera, this.fit(target, offset));
    }
    const distance = Math.max(wanted, this.fit(target, offset));
    this.camera.near = 0.02 * size;
    this.camera.far = distance + 30 * size;
    this.camera.position.copy(target).addScaledVector(offset, distance);
    this.camera.updateProjectionMatrix();
    this.controls.target.copy(target);
    this.controls.minDistance = 0.1 * size;
    this.controls.maxDistance = 15 * size;
    this.controls.update();
    this.changeView();
  }

  reframe(): void {
    if (this.framed) this.frame(this.framed.points, this.framed.scene);
  }

  /** Turns the picture about what is looked at, degrees to the right and up. */
  turn(right: number, up: number): void {
    const { target } = this.controls;
    const seen = new THREE.Spherical().setFromVector3(new THREE.Vector3(...toYUp(this.camera.position.clone().sub(target))));
    seen.theta += THREE.MathUtils.degToRad(right);
    seen.phi -= THREE.MathUtils.degToRad(up);
    seen.makeSafe();
    const { x, y, z } = new THREE.Vector3().setFromSpherical(seen);
    this.camera.position.set(x, -z, y).add(target);
    this.controls.update();
  }

  /** Makes the bodies larger by a factor, as far as the camera may go. */
  zoom(factor: number): void {
    const { target } = this.controls;
    this.camera.position.sub(target).divideScalar(factor).add(target);
    this.controls.update();
  }

  /** Unit vector from what is looked at to the viewer. */
  towardsViewer(): THREE.Vector3 {
    return this.camera.position.clone().sub(this.controls.target).normalize();
  }

  /** A ray through a point of the window, in CSS pixels. */
  rayThrough(clientX: number, clientY: number): THREE.Raycaster {
    const box = this.canvas.getBoundingClientRect();
    const place = new THREE.Vector2(
      (2 * (clientX - box.left)) / box.width - 1,
      1 - (2 * (clientY - box.top)) / box.height,
    );
    const raycaster = new THREE.Raycaster();
    this.camera.updateMatrixWorld();
    raycaster.setFromCamera(place, this.camera);
    return raycaster;
  }

  /** Window coordinates of a point of the world, in CSS pixels. */
  project(point: THREE.Vector3): [number, number] {
    const box = this.canvas.getBoundingClientRect();
    this.camera.updateMatrixWorld();
    const { x, y } = point.clone().project(this.camera);
    return [box.left + ((x + 1) / 2) * box.width, box.top + ((1 - y) / 2) * box.height];
  }

  /** Metres at a point of the world that one CSS pixel covers across the line of sight. */
  metresPerPixel(point: THREE.Vector3): number {
    const forward = this.camera.getWorldDirection(new THREE.Vector3());
    const depth = point.clone().sub(this.camera.position).dot(forward);
    return (2 * depth * Math.tan(THREE.MathUtils.degToRad(FIELD_OF_VIEW_DEG) / 2)) / this.canvas.clientHeight;
  }

  /** Draws at once. */
  render(): void {
    this.renderer.render(this.scene, this.camera);
  }

  /** Draws at once with all pixels of the screen, too many for every frame of a large window, and lets them be copied. */
  renderInFull(copy: () => void): void {
    const ratio = this.renderer.getPixelRatio();
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, PIXEL_RATIO_MAX));
    this.render();
    copy();
    this.renderer.setPixelRatio(ratio);
    this.render();
  }

  /** Calls a listener whenever the bodies are seen from elsewhere, or larger, or smaller. */
  onView(listener: () => void): void {
    this.viewListeners.push(listener);
  }

  private tick(): void {
    if (this.beforeDraw()) this.dirty = true;
    if (this.dirty) {
      this.dirty = false;
      this.render();
    }
    this.afterDraw();
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas.parentElement!;
    if (clientWidth === 0 || clientHeight === 0) return;
    const fitBefore = this.fitHere();
    const affordable = Math.sqrt(PIXELS_MAX / (clientWidth * clientHeight));
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, PIXEL_RATIO_MAX, affordable));
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    this.centreInFreeRegion();
    // The body keeps its share of the window, whatever the user's own view.
    const { target } = this.controls;
    if (fitBefore > 0) {
      this.camera.position.sub(target).multiplyScalar(this.fitHere() / fitBefore).add(target);
    }
    this.render();
    this.changeView();
  }

  private changeView(): void {
    this.invalidate();
    for (const listener of this.viewListeners) listener();
  }

  private fitHere(): number {
    return this.fit(this.controls.target, this.towardsViewer());
  }

  private fit(target: THREE.Vector3, towardsViewer: THREE.Vector3): number {
    if (!this.framed) return 0;
    const { points, scene } = this.framed;
    const { camera, region, pictureHeight } = this;
    const room = 2 * Math.max(0, ...scene.tools.map(({ radius }) => radius));
    return fitDistance(points, target, towardsViewer, camera, room, region, pictureHeight);
  }

  /** What the camera looks at stands in the middle of the region that nothing is written over. */
  private centreInFreeRegion(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.region = freeRegion(this.canvas, this.overlays);
    this.pictureHeight = height;
    const { left, top } = this.region;
    const [x, y] = [left + this.region.width / 2 - width / 2, top + this.region.height / 2 - height / 2];
    this.camera.setViewOffset(width, height, -x, -y, width, height);
  }

  /** Key and fill travel with the camera, so that a dent shades the same from every side. */
  private addLights(): void {
    const sky = new THREE.HemisphereLight(0xfff6ec, 0x7d5a4c, 1.35);
    sky.position.set(0, 0, 1);
    const key = new THREE.DirectionalLight(0xffedd8, 2.9);
    key.position.set(-0.55, 0.8, 1.5);
    const fill = new THREE.DirectionalLight(0xf2ece6, 0.8);
    fill.position.set(1, -0.5, 1);
    for (const light of [key, fill]) {
      // A light shines towards its target; a target that is a child too keeps the direction fixed to the camera.
      this.camera.add(light, light.target);
    }
    this.scene.add(this.camera, sky);
  }
}

/** three's spherical coordinates have y upwards; here it is z. */
function toYUp({ x, y, z }: THREE.Vector3): [number, number, number] {
  return [x, z, -y];
}

function drawsInSoftware(): boolean {
  const probe = document.createElement("canvas").getContext("webgl2");
  if (!probe) return false;
  const name = String(probe.getParameter(probe.RENDERER));
  probe.getExtension("WEBGL_lose_context")?.loseContext();
  return SOFTWARE_DRIVER.test(name);
}
