// Colours of the regions of a body, as the shader looks them up.

import * as THREE from "three";

/** Colours of a body's regions, one texel each. */
export function regionTexture(colors: THREE.Color[]): THREE.DataTexture {
  const texels = new Uint8Array(colors.flatMap((color) => [...bytesOf(color), 255]));
  const texture = new THREE.DataTexture(texels, colors.length, 1);
  texture.colorSpace = THREE.SRGBColorSpace;
  texture.needsUpdate = true;
  return texture;
}

function bytesOf(color: THREE.Color): number[] {
  const hex = color.getHex(THREE.SRGBColorSpace);
  return [hex >> 16, (hex >> 8) & 255, hex & 255];
}
