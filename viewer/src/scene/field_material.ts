// Tissue, the colours of a field, or those of regions: one lit material whose base colour is exchanged in the shader, and
// that is not drawn where the body is cut away.

import * as THREE from "three";

/** What the base colour is taken from. */
export const TISSUE = 0;
export const FIELD = 1;
export const REGION = 2;

/** Shared by the solid and the face of a cut, so that one switch turns both. */
export interface FieldUniforms {
  colorMap: { value: THREE.DataTexture };
  regionColors: { value: THREE.DataTexture };
  coloring: { value: typeof TISSUE | typeof FIELD | typeof REGION };
  /** Whether some of the surface cannot be touched yet. */
  marked: { value: boolean };
  /** Whether a value of 0 stands for none: a triangle with such a corner shows the tissue. */
  gaps: { value: boolean };
}

/** What lies beyond normal . x = w, at rest, is not drawn: the normal, and w. */
export type CutUniform = { value: THREE.Vector4 };

/** A plane that has everything on its near side. */
export function noCut(): CutUniform {
  return { value: new THREE.Vector4(0, 0, 0, 1) };
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

/** Of what cannot be touched: ever, yet, asked for, painted. The panel's legend has the same (paint.css). */
export const MARK_COLORS = { never: 0x33363c, later: 0x70757d, waiting: 0xe69f00, painted: 0x56b4e9 } as const;

function glsl(color: number): string {
  return `vec3(${new THREE.Color(color).toArray().map((part) => part.toFixed(4)).join()})`;
}

/**
 * Attributes: value of the field, brightness of the tissue, rank of the region, place at rest, and as 1 in one of four
 * places what cannot be touched, in the order of the colours above. The place is linear over a triangle, so the edge of
 * what is drawn is that of the plane.
 */
const VERTEX_HEAD = /* glsl */ `
attribute float scalar;
attribute float shade;
attribute float region;
attribute vec3 rest;
attribute vec4 mark;
uniform vec4 cutPlane;
varying float vField;
varying float vKnown;
varying float vShade;
varying float vRegion;
varying float vBeyond;
varying vec4 vMark;
`;
const VERTEX_BEGIN = /* glsl */ `
vec3 transformed = vec3(position);
vField = scalar;
vKnown = step(0.5 / 255.0, scalar);
vShade = shade;
vRegion = region;
vBeyond = dot(rest, cutPlane.xyz) - cutPlane.w;
vMark = mark;
`;

const FRAGMENT_HEAD = /* glsl */ `
uniform sampler2D colorMap;
uniform sampler2D regionColors;
uniform int coloring;
uniform bool gaps;
uniform bool marked;
varying vec4 vMark;
varying float vField;
varying float vKnown;
varying float vShade;
varying float vRegion;
varying float vBeyond;
`;

// Whole pixels are discarded, with all of their samples: one more of the skin is kept, or a gap would open to the face of the
// cut. vShade varies the tissue a little, so that shape can be read where light alone would leave it flat.
const FRAGMENT_COLOR = /* glsl */ `
if (vBeyond > fwidth(vBeyond)) discard;
if (coloring == ${TISSUE} || (coloring == ${FIELD} && gaps && vKnown < 0.999)) diffuseColor.rgb *= vShade;
else if (coloring == ${FIELD}) {
  float part = gaps ? (vField * 255.0 - 1.0) / 254.0 : vField;
  diffuseColor.rgb = texture2D(colorMap, vec2(part, 0.5)).rgb;
}
else diffuseColor.rgb = texelFetch(regionColors, ivec2(int(vRegion + 0.5), 0), 0).rgb;
if (marked) {
  if (vMark.w > 0.5) diffuseColor.rgb = mix(diffuseColor.rgb, ${glsl(MARK_COLORS.painted)}, 0.85);
  else if (vMark.z > 0.5) diffuseColor.rgb = mix(diffuseColor.rgb, ${glsl(MARK_COLORS.waiting)}, 0.8);
  else if (vMark.y > 0.5) diffuseColor.rgb = mix(diffuseColor.rgb, ${glsl(MARK_COLORS.later)}, 0.85);
  else if (vMark.x > 0.5) diffuseColor.rgb = mix(diffuseColor.rgb, ${glsl(MARK_COLORS.never)}, 0.85);
}
`;

export function createFieldMaterial(
  parameters: THREE.MeshPhysicalMaterialParameters,
  uniforms: FieldUniforms,
  cutPlane = noCut(),
): THREE.MeshPhysicalMaterial {
  const material = new THREE.MeshPhysicalMaterial(parameters);
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, uniforms, { cutPlane });
    shader.vertexShader = VERTEX_HEAD + shader.vertexShader.replace("#include <begin_vertex>", VERTEX_BEGIN);
    shader.fragmentShader =
      FRAGMENT_HEAD +
      shader.fragmentShader.replace("#include <color_fragment>", `#include <color_fragment>\n${FRAGMENT_COLOR}`);
  };
  return material;
}
