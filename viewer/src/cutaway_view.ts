// The tetrahedra, with those on one side of a plane left out (Fig. 3 of the paper).
// All of them stay on the device as instances; the vertex shader fetches their moving corners from a texture and folds
// those beyond the plane to a point. Moving the plane or a node costs no rebuilding.

import * as THREE from "three";

import { createFieldMaterial } from "./field_material";
import type { FieldUniforms } from "./field_material";
import type { SceneArrays } from "./protocol";

/** Nodes per row of the texture; any power of two below the limit of WebGL 2 (2048) will do. */
const TEXTURE_WIDTH = 1024;
/** Faces of a positively oriented tetrahedron, outward. */
const FACES = [0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2];

const VERTEX = {
  head: /* glsl */ `
attribute uvec4 tetNodes;
attribute vec3 restCentre;
uniform highp sampler2D nodeTexture;
uniform vec4 cutPlane;
uniform float fieldMax;
vec4 nodeAt(uint node) {
  return texelFetch(nodeTexture, ivec2(node % ${TEXTURE_WIDTH}u, node / ${TEXTURE_WIDTH}u), 0);
}`,
  // A gap of a tenth shows each element; the shade tells neighbours apart where the field is off.
  begin: /* glsl */ `
vec4 corner = nodeAt(tetNodes[int(position.x)]);
vec3 centre = (nodeAt(tetNodes.x).xyz + nodeAt(tetNodes.y).xyz + nodeAt(tetNodes.z).xyz + nodeAt(tetNodes.w).xyz) / 4.0;
bool removed = dot(restCentre, cutPlane.xyz) > cutPlane.w;
vec3 transformed = removed ? centre : mix(centre, corner.xyz, 0.9);
vField = corner.w / fieldMax;
vShade = 0.82 + 0.36 * fract(sin(float(tetNodes.x + 3u * tetNodes.y + 7u * tetNodes.z) * 12.9898) * 43758.5453);`,
};

export class CutawayView {
  readonly mesh: THREE.Mesh<THREE.InstancedBufferGeometry, THREE.MeshPhysicalMaterial>;
  private readonly texture: THREE.DataTexture;
  private readonly texels: Float32Array;
  private readonly cutPlane = { value: new THREE.Vector4(0, 0, 0, 1) };
  private readonly fieldMax = { value: 1 };

  constructor(private readonly arrays: SceneArrays, color: THREE.Color, uniforms: FieldUniforms) {
    const rows = Math.max(1, Math.ceil(arrays.nodes.length / 3 / TEXTURE_WIDTH));
    this.texels = new Float32Array(4 * TEXTURE_WIDTH * rows);
    this.texture = new THREE.DataTexture(this.texels, TEXTURE_WIDTH, rows, THREE.RGBAFormat, THREE.FloatType);
    const material = createFieldMaterial(
      { color, roughness: 0.6, flatShading: true },
      { ...uniforms, nodeTexture: { value: this.texture }, cutPlane: this.cutPlane, fieldMax: this.fieldMax },
      VERTEX,
    );
    this.mesh = new THREE.Mesh(tetGeometry(arrays), material);
    this.mesh.frustumCulled = false;
    this.displaceAll(null, null, 1);
  }

  /** Removes what lies beyond the plane: normal . x > offset, at rest. */
  setPlane(normal: THREE.Vector3, offset: number): void {
    this.cutPlane.value.set(normal.x, normal.y, normal.z, offset);
  }

  /** Displacements of the nodes in rows (all nodes if null); max is the displacement at the end of the colour map, m. */
  displaceAll(displacements: Float32Array | null, rows: Uint32Array | null, max: number): void {
    const { nodes } = this.arrays;
    const count = rows ? rows.length : nodes.length / 3;
    for (let i = 0; i < count; i++) {
      const node = rows ? rows[i]! : i;
      const ux = displacements ? displacements[3 * i]! : 0;
      const uy = displacements ? displacements[3 * i + 1]! : 0;
      const uz = displacements ? displacements[3 * i + 2]! : 0;
      this.texels[4 * node] = nodes[3 * node]! + ux;
      this.texels[4 * node + 1] = nodes[3 * node + 1]! + uy;
      this.texels[4 * node + 2] = nodes[3 * node + 2]! + uz;
      this.texels[4 * node + 3] = Math.sqrt(ux * ux + uy * uy + uz * uz);
    }
    this.fieldMax.value = max > 0 ? max : 1;
    this.texture.needsUpdate = true;
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
    this.texture.dispose();
  }
}

function tetGeometry(arrays: SceneArrays): THREE.InstancedBufferGeometry {
  const geometry = new THREE.InstancedBufferGeometry();
  // Only the number of the corner stands here; the shader finds the place.
  const corners = new Float32Array(3 * FACES.length);
  FACES.forEach((corner, i) => (corners[3 * i] = corner));
  const centres = new Float32Array((3 * arrays.tets.length) / 4);
  for (let tet = 0; tet < arrays.tets.length / 4; tet++) {
    for (let axis = 0; axis < 3; axis++) {
      let sum = 0;
      for (let corner = 0; corner < 4; corner++) sum += arrays.nodes[3 * arrays.tets[4 * tet + corner]! + axis]!;
      centres[3 * tet + axis] = sum / 4;
    }
  }
  geometry.setAttribute("position", new THREE.BufferAttribute(corners, 3));
  geometry.setAttribute("tetNodes", new THREE.InstancedBufferAttribute(arrays.tets, 4));
  geometry.setAttribute("restCentre", new THREE.InstancedBufferAttribute(centres, 3));
  geometry.instanceCount = arrays.tets.length / 4;
  return geometry;
}
