// Target of a tool that the strain limit holds back: a ring at the pointer, and a line to it from the tool.

import * as THREE from "three";

import type { Vec3 } from "../net/protocol";

const COLOR = 0xffd08a;
/** Inner over outer radius of the ring, and its outer radius over that of the tool. */
const RING_THICKNESS = 0.88;
const RING_SIZE = 0.75;

export class LimitView {
  readonly group = new THREE.Group();
  private readonly ring: THREE.Mesh<THREE.RingGeometry, THREE.MeshBasicMaterial>;
  private readonly line: THREE.Line<THREE.BufferGeometry, THREE.LineDashedMaterial>;

  constructor(toolRadius: number) {
    // Seen through the body: the pointer is inside it.
    const look = { color: COLOR, transparent: true, depthTest: false, depthWrite: false };
    const outer = RING_SIZE * toolRadius;
    this.ring = new THREE.Mesh(
      new THREE.RingGeometry(RING_THICKNESS * outer, outer, 48),
      new THREE.MeshBasicMaterial({ ...look, opacity: 0.95 }),
    );
    this.ring.onBeforeRender = (_renderer, _scene, camera) => {
      this.ring.quaternion.copy(camera.quaternion);
      this.ring.updateMatrixWorld();
    };
    const dash = 0.3 * toolRadius;
    this.line = new THREE.Line(
      new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(new Float32Array(6), 3)),
      new THREE.LineDashedMaterial({ ...look, opacity: 0.9, dashSize: dash, gapSize: 0.6 * dash }),
    );
    for (const part of [this.ring, this.line]) {
      part.renderOrder = 2;
      part.frustumCulled = false;
    }
    this.group.add(this.ring, this.line);
    this.group.visible = false;
  }

  /** wanted is null while the tool goes where it is told. */
  update(tool: Vec3, wanted: Vec3 | null): void {
    this.group.visible = wanted !== null;
    if (!wanted) return;
    this.ring.position.set(...wanted);
    const places = this.line.geometry.getAttribute("position");
    places.setXYZ(0, ...tool);
    places.setXYZ(1, ...wanted);
    places.needsUpdate = true;
    this.line.computeLineDistances();
  }
}
