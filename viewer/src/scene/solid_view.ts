// The deformed solid, with the colour field over it.

import * as THREE from "three";

import { createFieldMaterial } from "./field_material";
import type { FieldUniforms } from "./field_material";
import { SHOWN_SCALE_MAX } from "../store";
import type { Surface } from "./surface";

const VERTEX = {
  head: "attribute float scalar;\nattribute float shade;",
  begin: "vec3 transformed = vec3(position);\nvField = scalar;\nvShade = shade;",
};

export class SolidView {
  readonly mesh: THREE.Mesh<THREE.BufferGeometry, THREE.MeshPhysicalMaterial>;
  private readonly scalar: THREE.BufferAttribute;

  constructor(private readonly surface: Surface, color: THREE.Color, size: number, uniforms: FieldUniforms) {
    const geometry = new THREE.BufferGeometry();
    const dynamic = (array: THREE.TypedArray, itemSize: number, normalized = false) =>
      new THREE.BufferAttribute(array, itemSize, normalized).setUsage(THREE.DynamicDrawUsage);
    this.scalar = dynamic(new Uint8Array(surface.count), 1, true);
    geometry.setIndex(new THREE.BufferAttribute(surface.triangles, 1));
    geometry.setAttribute("position", dynamic(surface.shown, 3));
    geometry.setAttribute("normal", dynamic(surface.shownNormals, 3));
    geometry.setAttribute("scalar", this.scalar);
    geometry.setAttribute("shade", new THREE.BufferAttribute(mottle(surface.rest, size), 1));
    geometry.computeBoundingSphere();
    // Room for the largest deformation as it may be drawn, so that the sphere that picking consults never goes stale.
    geometry.boundingSphere!.radius += (SHOWN_SCALE_MAX * size) / 2;
    const material = createFieldMaterial(
      {
        color,
        roughness: 0.46,
        clearcoat: 0.35,
        clearcoatRoughness: 0.32,
        // Lines of the rest shape lie in the same place where nothing moves: push the solid behind them.
        polygonOffset: true,
        polygonOffsetFactor: 1,
        polygonOffsetUnits: 1,
      },
      { ...uniforms },
      VERTEX,
    );
    this.mesh = new THREE.Mesh(geometry, material);
    this.mesh.frustumCulled = false;
  }

  /** Call after the surface was displaced. */
  update(scalar: Uint8Array): void {
    if (scalar.length === this.surface.count) (this.scalar.array as Uint8Array).set(scalar);
    this.scalar.needsUpdate = true;
    this.mesh.geometry.getAttribute("position").needsUpdate = true;
    this.mesh.geometry.getAttribute("normal").needsUpdate = true;
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
  }
}

/** Brightness of the tissue at each node: slow waves with no common period, within 8 %. */
function mottle(rest: Float32Array, size: number): Float32Array {
  const shades = new Float32Array(rest.length / 3);
  for (let i = 0; i < shades.length; i++) {
    const [x, y, z] = [rest[3 * i]! / size, rest[3 * i + 1]! / size, rest[3 * i + 2]! / size];
    const waves = Math.sin(23 * x + 11 * y) + Math.sin(19 * y - 13 * z + 1) + Math.sin(29 * z + 17 * x + 2);
    shades[i] = 1 + 0.027 * waves;
  }
  return shades;
}
