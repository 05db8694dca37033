// Colours of the regions of a body, as the shader looks them up.

import * as THREE from "three";

/** Colours of a body's regions, one texel each. */
export function regionTexture(colors: THREE.Color[]): THREE.DataTexture {
  return colorTexture(new Uint8Array(colors.flatMap((color) => [...bytesOf(color), 255])), colors.length);
}

/** A texture of sRGB colours with their opacity, so many to a row. */
export function colorTexture(texels: Uint8Array, width: number): THREE.DataTexture {
  const texture = new THREE.DataTexture(texels, width, texels.length / (4 * width));
  texture.colorSpace = THREE.SRGBColorSpace;
  texture.needsUpdate = true;
  return texture;
}

function bytesOf(color: THREE.Color): number[] {
  const hex = color.getHex(THREE.SRGBColorSpace);
  return [hex >> 16, (hex >> 8) & 255, hex & 255];
}
