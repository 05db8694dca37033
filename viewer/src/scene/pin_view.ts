// A pin in a tool that stays where it was left.

import * as THREE from "three";

const COLOR = "#6fc3ff";
const EDGE = "#14171c";
const PIXELS = 128;
/** Height at a distance of one; the picture is 2 tan(35 deg / 2) = 0.63 high there. */
const HEIGHT = 0.035;

export class PinView {
  readonly sprite: THREE.Sprite;

  constructor() {
    // Seen through the body: a pinned tool may be deep in a dent.
    const material = new THREE.SpriteMaterial({
      map: pinTexture(),
      depthTest: false,
      depthWrite: false,
      // As large on the screen from wherever it is seen.
      sizeAttenuation: false,
    });
    this.sprite = new THREE.Sprite(material);
    // The tip is at the tool's centre.
    this.sprite.center.set(0.5, 0.04);
    this.sprite.scale.setScalar(HEIGHT);
    this.sprite.renderOrder = 3;
    this.sprite.visible = false;
  }
}

/** A drop upside down with a hole, as on maps. */
function pinTexture(): THREE.CanvasTexture {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = PIXELS;
  const context = canvas.getContext("2d")!;
  const [middle, top, radius] = [PIXELS / 2, 0.36 * PIXELS, 0.27 * PIXELS];
  context.beginPath();
  context.arc(middle, top, radius, 0.85 * Math.PI, 0.15 * Math.PI);
  context.lineTo(middle, 0.96 * PIXELS);
  context.closePath();
  context.fillStyle = COLOR;
  context.strokeStyle = EDGE;
  context.lineWidth = 0.04 * PIXELS;
  context.lineJoin = "round";
  context.fill();
  context.stroke();
  context.beginPath();
  context.arc(middle, top, 0.4 * radius, 0, 2 * Math.PI);
  context.fillStyle = EDGE;
  context.fill();
  const texture = new THREE.CanvasTexture(canvas);
  texture.colorSpace = THREE.SRGBColorSpace;
  return texture;
}
