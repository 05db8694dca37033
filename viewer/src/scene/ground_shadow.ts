// The soft shadow on the ground below a body at rest: computed once from its shape, drawn as one textured rectangle.

import * as THREE from "three";

import { colorTexture } from "./region_texture";
import { shadowOf } from "./shadow_map";

/** The ground lies below the body by this share of the scene, so that neither cuts the other. */
const BELOW = 0.012;
/** Warm, as the light is. */
const COLOR = [14, 9, 6] as const;

export type GroundShadow = THREE.Mesh<THREE.PlaneGeometry, THREE.MeshBasicMaterial>;

/** From points (n, 3) in the scene, m, and triangles (k, 3). */
export function createGroundShadow(points: Float32Array, triangles: Uint32Array, size: number): GroundShadow {
  const { darkness, width, left, bottom, ground } = shadowOf(points, triangles);
  const pixels = Math.sqrt(darkness.length);
  const texels = new Uint8Array(4 * darkness.length);
  darkness.forEach((part, i) => texels.set([...COLOR, Math.round(255 * part)], 4 * i));
  const texture = colorTexture(texels, pixels);
  texture.magFilter = texture.minFilter = THREE.LinearFilter;
  const material = new THREE.MeshBasicMaterial({ map: texture, transparent: true, depthWrite: false });
  const mesh: GroundShadow = new THREE.Mesh(new THREE.PlaneGeometry(width, width), material);
  mesh.position.set(left + width / 2, bottom + width / 2, ground - BELOW * size);
  mesh.renderOrder = -1;
  return mesh;
}
