// The tetrahedra, with those on one side of a plane left out (Fig. 3 of the paper).
// All of them stay on the device as instances; the vertex shader fetches their moving corners from a texture and folds
// those beyond the plane to a point. Moving the plane or a node costs no rebuilding.

import * as THREE from "three";

import { TET_FACES, faceOwners } from "./face_owners";
import { createFieldMaterial } from "./field_material";
import type { FieldUniforms } from "./field_material";
import type { BodyArrays } from "../net/protocol";

/** Nodes per row of the texture; any power of two below the limit of WebGL 2 (2048) will do. */
const TEXTURE_WIDTH = 1024;
const VERTEX = {
  head: /* glsl */ `
attribute uvec4 tetNodes;
attribute vec3 restCentre;
uniform highp sampler2D nodeTexture;
uniform vec4 cutPlane;
vec4 nodeAt(uint node) {
  return texelFetch(nodeTexture, ivec2(node % ${TEXTURE_WIDTH}u, node / ${TEXTURE_WIDTH}u), 0);
}`,
  // A gap of a tenth shows each element; the shade tells neighbours apart where the field is off.
  begin: /* glsl */ `
vec4 corner = nodeAt(tetNodes[int(position.x)]);
vec3 centre = (nodeAt(tetNodes.x).xyz + nodeAt(tetNodes.y).xyz + nodeAt(tetNodes.z).xyz + nodeAt(tetNodes.w).xyz) / 4.0;
bool removed = dot(restCentre, cutPlane.xyz) > cutPlane.w;
vec3 transformed = removed ? centre : mix(centre, corner.xyz, 0.9);
vField = corner.w;
vShade = 0.82 + 0.36 * fract(sin(float(tetNodes.x + 3u * tetNodes.y + 7u * tetNodes.z) * 12.9898) * 43758.5453);`,
};

export class CutawayView {
  readonly mesh: THREE.Mesh<THREE.InstancedBufferGeometry, THREE.MeshPhysicalMaterial>;
  private readonly texture: THREE.DataTexture;
  private readonly texels: Float32Array;
  private readonly cutPlane = { value: new THREE.Vector4(0, 0, 0, 1) };
  private readonly centres: Float32Array;
  private readonly owners: Uint32Array;

  constructor(private readonly arrays: BodyArrays, color: THREE.Color, uniforms: FieldUniforms) {
    const rows = Math.max(1, Math.ceil(arrays.nodes.length / 3 / TEXTURE_WIDTH));
    this.texels = new Float32Array(4 * TEXTURE_WIDTH * rows);
    this.texture = new THREE.DataTexture(this.texels, TEXTURE_WIDTH, rows, THREE.RGBAFormat, THREE.FloatType);
    const material = createFieldMaterial(
      { color, roughness: 0.6, flatShading: true },
      { ...uniforms, nodeTexture: { value: this.texture }, cutPlane: this.cutPlane },
      VERTEX,
    );
    this.centres = tetCentres(arrays);
    this.owners = faceOwners(arrays);
    this.mesh = new THREE.Mesh(tetGeometry(arrays.tets, this.centres), material);
    this.mesh.frustumCulled = false;
    const { nodes } = arrays;
    this.displaceAll(new Float32Array(nodes.length), new Uint8Array(nodes.length / 3), null, 1);
  }

  /** Removes what lies beyond the plane: normal . x > offset, at rest. */
  setPlane(normal: THREE.Vector3, offset: number): void {
    this.cutPlane.value.set(normal.x, normal.y, normal.z, offset);
  }

  /** Whether the tetrahedron behind a triangle of the surface is gone. */
  removes(triangle: number): boolean {
    const { x, y, z, w: offset } = this.cutPlane.value;
    const at = 3 * this.owners[triangle]!;
    return x * this.centres[at]! + y * this.centres[at + 1]! + z * this.centres[at + 2]! > offset;
  }

  /** Displacements, m, drawn times a scale, and values of the field, 0..255, of the nodes in rows (all nodes if null). */
  displaceAll(displacements: Float32Array, scalar: Uint8Array, rows: Uint32Array | null, scale: number): void {
    const { nodes } = this.arrays;
    const count = rows ? rows.length : nodes.length / 3;
    for (let i = 0; i < count; i++) {
      const node = rows ? rows[i]! : i;
      for (let axis = 0; axis < 3; axis++) {
        this.texels[4 * node + axis] = nodes[3 * node + axis]! + scale * displacements[3 * i + axis]!;
      }
      this.texels[4 * node + 3] = scalar[i]! / 255;
    }
    this.texture.needsUpdate = true;
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
    this.texture.dispose();
  }
}

function tetCentres(arrays: BodyArrays): Float32Array {
  const centres = new Float32Array((3 * arrays.tets.length) / 4);
  for (let tet = 0; tet < arrays.tets.length / 4; tet++) {
    for (let axis = 0; axis < 3; axis++) {
      let sum = 0;
      for (let corner = 0; corner < 4; corner++) sum += arrays.nodes[3 * arrays.tets[4 * tet + corner]! + axis]!;
      centres[3 * tet + axis] = sum / 4;
    }
  }
  return centres;
}

function tetGeometry(tets: Uint32Array, centres: Float32Array): THREE.InstancedBufferGeometry {
  const geometry = new THREE.InstancedBufferGeometry();
  // Only the number of the corner stands here; the shader finds the place.
  const corners = new Float32Array(3 * TET_FACES.length);
  TET_FACES.forEach((corner, i) => (corners[3 * i] = corner));
  geometry.setAttribute("position", new THREE.BufferAttribute(corners, 3));
  geometry.setAttribute("tetNodes", new THREE.InstancedBufferAttribute(tets, 4));
  geometry.setAttribute("restCentre", new THREE.InstancedBufferAttribute(centres, 3));
  geometry.instanceCount = tets.length / 4;
  return geometry;
}
