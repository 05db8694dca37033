// Tissue, the colours of a field, or those of regions: one physically based material whose base colour is exchanged in the
// shader, and that is not drawn where the body is cut away. A studio is reflected in it that costs no texture: a soft box
// above and a strip at the left, and tissue lets some light through where the view grazes it.

import * as THREE from "three";

/** How much of the base colour is that of the field: everywhere, and where its value is far from zero. */
export interface FieldShares {
  everywhere: number;
  strained: number;
}

/** Shared by the solid and the face of a cut, so that one switch turns both. */
export interface FieldUniforms {
  colorMap: { value: THREE.DataTexture };
  regionColors: { value: THREE.DataTexture };
  /** Whether regions have their colours, whatever the field is. */
  byRegion: { value: boolean };
  fieldShares: { value: THREE.Vector2 };
  /** Whether zero is in the middle of the colours of the field. */
  signed: { value: boolean };
  /** One over the size of the scene, 1/m: the grain of tissue does not depend on the unit of length. */
  grain: { value: number };
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

/** Parts of the range of a field between which its colours come out of the tissue. */
const [STRAINED_FROM, STRAINED_TO] = ["0.08", "0.5"];

/** Base colours of tissue by a word in the model's name; anything else looks like silicone. */
const TISSUE_COLORS: [RegExp, number][] = [
  [/liver/i, 0x86352b],
  [/kidney/i, 0x93443a],
  [/spleen/i, 0x7f3142],
  [/heart/i, 0xab3c38],
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
varying vec3 vGrain;
uniform float grain;
`;
const VERTEX_BEGIN = /* glsl */ `
vec3 transformed = vec3(position);
vField = scalar;
vKnown = step(0.5 / 255.0, scalar);
vShade = shade;
vRegion = region;
vBeyond = dot(rest, cutPlane.xyz) - cutPlane.w;
vMark = mark;
vGrain = grain * rest;
`;

const FRAGMENT_HEAD = /* glsl */ `
uniform sampler2D colorMap;
uniform sampler2D regionColors;
uniform bool byRegion;
uniform vec2 fieldShares;
uniform bool signed;
uniform bool gaps;
uniform bool marked;
varying vec4 vMark;
varying float vField;
varying float vKnown;
varying float vShade;
varying float vRegion;
varying float vBeyond;
varying vec3 vGrain;

// Fine waves that bend each other: no two places look alike, for three sines a pixel.
float tissueGrain(vec3 p) {
  vec3 bent = 61.0 * p + 2.2 * sin(34.0 * p.yzx + 1.3);
  vec3 waves = sin(bent + sin(2.3 * bent.zxy));
  return waves.x * waves.y + waves.z * 0.5;
}
`;

// Whole pixels are discarded, with all of their samples: one more of the skin is kept, or a gap would open to the face of the
// cut. vShade varies the tissue a little, so that shape can be read where light alone would leave it flat.
const FRAGMENT_COLOR = /* glsl */ `
if (vBeyond > fwidth(vBeyond)) discard;
float tissueShare = 0.0;
if (byRegion) diffuseColor.rgb = texelFetch(regionColors, ivec2(int(vRegion + 0.5), 0), 0).rgb;
else {
  float part = gaps ? (vField * 255.0 - 1.0) / 254.0 : vField;
  float strained = smoothstep(${STRAINED_FROM}, ${STRAINED_TO}, signed ? abs(2.0 * part - 1.0) : part);
  float share = gaps && vKnown < 0.999 ? 0.0 : max(fieldShares.x, fieldShares.y * strained);
  tissueShare = 1.0 - share;
  if (tissueShare > 0.0) diffuseColor.rgb *= vShade * (1.0 + 0.05 * tissueGrain(vGrain));
  if (share > 0.0) diffuseColor.rgb = mix(diffuseColor.rgb, texture2D(colorMap, vec2(part, 0.5)).rgb, share);
}
if (marked) {
  if (vMark.w > 0.5) diffuseColor.rgb = mix(diffuseColor.rgb, ${glsl(MARK_COLORS.painted)}, 0.85);
  else if (vMark.z > 0.5) diffuseColor.rgb = mix(diffuseColor.rgb, ${glsl(MARK_COLORS.waiting)}, 0.8);
  else if (vMark.y > 0.5) diffuseColor.rgb = mix(diffuseColor.rgb, ${glsl(MARK_COLORS.later)}, 0.85);
  else if (vMark.x > 0.5) diffuseColor.rgb = mix(diffuseColor.rgb, ${glsl(MARK_COLORS.never)}, 0.85);
}
`;

/**
 * The studio, in the frame of the camera, as the key light is: nothing is looked up, so that drawing in software stays
 * quick. Schlick's approximation (1994) with 0.04, the reflectance of water at normal incidence: tissue is moist.
 */
const FRAGMENT_STUDIO = /* glsl */ `
{
  vec3 eye = normalize(vViewPosition);
  float facing = clamp(dot(normal, eye), 0.0, 1.0);
  float grazing = 1.0 - facing;
  float grazing2 = grazing * grazing;
  float fresnel = 0.04 + 0.96 * grazing2 * grazing2 * grazing;
  vec3 mirror = reflect(-eye, normal);
  float above = smoothstep(0.35, 0.95, mirror.y);
  float strip = smoothstep(0.55, 0.9, -mirror.x) * smoothstep(-0.6, 0.3, mirror.y);
  // Colours that mean a number are not washed out.
  outgoingLight += (0.15 + 0.85 * tissueShare) * fresnel * (vec3(1.1, 1.04, 0.96) * above + 0.5 * vec3(0.86, 0.92, 1.0) * strip);
  outgoingLight += tissueShare * diffuseColor.rgb * vec3(0.4, 0.13, 0.1) * grazing2 * (0.5 + 0.5 * normal.y);
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
      shader.fragmentShader
        .replace("#include <color_fragment>", `#include <color_fragment>\n${FRAGMENT_COLOR}`)
        .replace("#include <opaque_fragment>", `${FRAGMENT_STUDIO}\n#include <opaque_fragment>`);
  };
  return material;
}
