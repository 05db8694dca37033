// Tissue, or the colour field over it: one lit material whose base colour is exchanged in the shader.

import * as THREE from "three";

/** Shared by the solid and the cut-away, so that one switch turns both. */
export interface FieldUniforms {
  colorMap: { value: THREE.DataTexture };
  /** 1 shows the field, 0 the tissue. */
  fieldShown: { value: number };
}

/** Base colours of tissue by a word in the model's name; anything else looks like silicone. */
const TISSUE_COLORS: [RegExp, number][] = [
  [/liver/i, 0x8e3a30],
  [/kidney/i, 0x9c4a3c],
  [/spleen/i, 0x7a3040],
  [/heart/i, 0xa83a38],
  [/brain/i, 0xc9a196],
  [/doll|face|skin|hand/i, 0xd2a084],
  [/beam|block|bar/i, 0xb58a6a],
];
const SILICONE = 0xc08b78;

export function tissueColor(name: string): THREE.Color {
  const found = TISSUE_COLORS.find(([pattern]) => pattern.test(name));
  return new THREE.Color(found ? found[1] : SILICONE);
}

const FRAGMENT_HEAD = /* glsl */ `
uniform sampler2D colorMap;
uniform float fieldShown;
varying float vField;
varying float vShade;
`;

// vShade varies the tissue a little, so that shape can be read where light alone would leave it flat. The map's alpha
// fades the field in from the tissue at its low end, and the legend shows the same.
const FRAGMENT_COLOR = /* glsl */ `
vec4 fieldColor = texture2D(colorMap, vec2(vField, 0.5));
diffuseColor.rgb = mix(diffuseColor.rgb * vShade, fieldColor.rgb, fieldColor.a * fieldShown);
`;

/** Vertex code of a material: declarations, and what stands in place of three's `begin_vertex`. */
export interface VertexCode {
  head: string;
  begin: string;
}

export function createFieldMaterial(
  parameters: THREE.MeshPhysicalMaterialParameters,
  uniforms: FieldUniforms & Record<string, THREE.IUniform>,
  vertex: VertexCode,
): THREE.MeshPhysicalMaterial {
  const material = new THREE.MeshPhysicalMaterial(parameters);
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, uniforms);
    shader.vertexShader =
      `varying float vField;\nvarying float vShade;\n${vertex.head}\n` +
      shader.vertexShader.replace("#include <begin_vertex>", vertex.begin);
    shader.fragmentShader =
      FRAGMENT_HEAD +
      shader.fragmentShader.replace("#include <color_fragment>", `#include <color_fragment>\n${FRAGMENT_COLOR}`);
  };
  // three reuses a compiled program for equal keys; the vertex code tells ours apart.
  material.customProgramCacheKey = () => vertex.head + vertex.begin;
  return material;
}
