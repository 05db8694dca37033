// The face at which a body is cut open: plane at rest, and deformed with the body from then on.

import * as THREE from "three";

import { createFieldMaterial } from "./field_material";
import type { FieldUniforms } from "./field_material";
import type { BodyArrays } from "../net/protocol";
import { planeSection } from "./plane_section";
import type { PlaneSection } from "./plane_section";
import { vertexNormals } from "./surface";

/** The inside is a little lighter than the skin. */
const LIGHTER = 0.14;

/** Displacements, m, drawn times a scale, and values of the field, 0..255, of all nodes of a body. */
interface NodePose {
  displacements: Float32Array;
  scalar: Uint8Array;
  scale: number;
}

export class SectionView {
  readonly mesh: THREE.Mesh<THREE.BufferGeometry, THREE.MeshPhysicalMaterial>;
  private plane = { normal: new THREE.Vector3(0, 0, 1), offset: Infinity };
  private section: PlaneSection;
  private pose: NodePose;

  constructor(private readonly arrays: BodyArrays, color: THREE.Color, uniforms: FieldUniforms) {
    const inside = color.clone().lerp(new THREE.Color(0xffffff), LIGHTER);
    const material = createFieldMaterial({ color: inside, roughness: 0.75 }, uniforms);
    this.mesh = new THREE.Mesh(new THREE.BufferGeometry(), material);
    this.mesh.frustumCulled = false;
    const { nodes } = arrays;
    this.pose = { displacements: new Float32Array(nodes.length), scalar: new Uint8Array(nodes.length / 3), scale: 1 };
    this.section = planeSection(arrays, [0, 0, 1], Infinity);
  }

  /** The face is where normal . x = offset at rest; what is beyond it is taken away. */
  setPlane(normal: THREE.Vector3, offset: number): void {
    if (this.plane.normal.equals(normal) && this.plane.offset === offset) return;
    this.plane = { normal: normal.clone(), offset };
    this.section = planeSection(this.arrays, normal.toArray(), offset);
    const { shares, regions, triangles } = this.section;
    this.mesh.geometry.dispose();
    const geometry = new THREE.BufferGeometry();
    const dynamic = (array: THREE.TypedArray, itemSize: number, normalized = false) =>
      new THREE.BufferAttribute(array, itemSize, normalized).setUsage(THREE.DynamicDrawUsage);
    geometry.setAttribute("position", dynamic(new Float32Array(3 * shares.length), 3));
    geometry.setAttribute("normal", dynamic(new Float32Array(3 * shares.length), 3));
    geometry.setAttribute("scalar", dynamic(new Uint8Array(shares.length), 1, true));
    geometry.setAttribute("shade", new THREE.BufferAttribute(new Float32Array(shares.length).fill(1), 1));
    geometry.setAttribute("region", new THREE.BufferAttribute(regions, 1));
    geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
    this.mesh.geometry = geometry;
    this.place();
  }

  displace(pose: NodePose): void {
    this.pose = pose;
    this.place();
  }

  /** Corners lie where their edges are now: straight edges stay straight. */
  private place(): void {
    const { ends, shares, triangles } = this.section;
    const { displacements, scalar, scale } = this.pose;
    const { nodes } = this.arrays;
    const { position, normal, scalar: shown } = this.mesh.geometry.attributes;
    if (!position || !normal || !shown) return;
    const [places, values] = [position.array as Float32Array, shown.array as Uint8Array];
    for (let i = 0; i < shares.length; i++) {
      const [a, b, share] = [ends[2 * i]!, ends[2 * i + 1]!, shares[i]!];
      for (let axis = 0; axis < 3; axis++) {
        const [low, high] = [3 * a + axis, 3 * b + axis];
        const first = nodes[low]! + scale * displacements[low]!;
        places[3 * i + axis] = first + share * (nodes[high]! + scale * displacements[high]! - first);
      }
      values[i] = Math.round(scalar[a]! + share * (scalar[b]! - scalar[a]!));
    }
    vertexNormals(places, triangles, normal.array as Float32Array);
    for (const attribute of [position, normal, shown]) attribute.needsUpdate = true;
  }
}
