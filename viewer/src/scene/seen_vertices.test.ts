import * as THREE from "three";
import { describe, expect, it } from "vitest";

import { withinStroke } from "../window_regions";
import { SeenVertices } from "./seen_vertices";
import type { SeenSurface } from "./seen_vertices";

const [WIDTH, HEIGHT, LEFT, TOP] = [800, 600, 20, 10];

/** A ball that is finer than the cells of the picture of distances, at a place. */
function ball(radius: number, x: number, y: number, z: number): SeenSurface {
  const { attributes, index } = new THREE.SphereGeometry(radius, 48, 32).translate(x, y, z);
  return {
    positions: new Float32Array(attributes["position"]!.array),
    normals: new Float32Array(attributes["normal"]!.array),
    triangles: new Uint32Array(index!.array),
    removed: () => false,
  };
}

const camera = new THREE.PerspectiveCamera(35, WIDTH / HEIGHT, 0.01, 10);
camera.position.set(0, -0.8, 0.1);
camera.up.set(0, 0, 1);
camera.lookAt(0, 0, 0);
camera.updateMatrixWorld();
const matrix = camera.projectionMatrix.clone().multiply(camera.matrixWorldInverse).elements;
const eye = { position: camera.position.toArray(), matrix, left: LEFT, top: TOP, width: WIDTH, height: HEIGHT };

function meshOf({ positions, triangles }: SeenSurface): THREE.Mesh {
  const geometry = new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(positions, 3));
  return new THREE.Mesh(geometry.setIndex(new THREE.BufferAttribute(triangles, 1)), new THREE.MeshBasicMaterial({ side: THREE.DoubleSide }));
}

describe("vertices that are seen", () => {
  const near = ball(0.05, 0.03, -0.2, 0.02);
  const far = ball(0.12, 0, 0, 0);
  const { of } = new SeenVertices([near, far], eye);

  it("are those that three's raycaster reaches first, but for a few at outlines", () => {
    const meshes = [near, far].map(meshOf);
    let [wrong, count] = [0, 0];
    [near, far].forEach(({ positions }, i) => {
      const found = new Set(of[i]!.vertices);
      for (let vertex = 0; vertex < positions.length / 3; vertex += 7) {
        const place = new THREE.Vector3().fromArray(positions, 3 * vertex);
        const direction = place.clone().sub(camera.position);
        const first = new THREE.Raycaster(camera.position, direction.clone().normalize()).intersectObjects(meshes)[0];
        const reached = first === undefined || first.distance > direction.length() * (1 - 1e-3);
        if (reached !== found.has(vertex)) wrong += 1;
        count += 1;
      }
    });
    expect(wrong).toBeLessThan(0.03 * count);
    // The ball behind has lost some of its front to the one before it: without hiding, more would be there.
    const alone = new SeenVertices([far], eye).of[0]!.vertices.length;
    expect(of[1]!.vertices.length).toBeLessThan(0.95 * alone);
  });

  it("have the places that the camera gives them", () => {
    of[0]!.vertices.forEach((vertex, i) => {
      const { x, y } = new THREE.Vector3().fromArray(near.positions, 3 * vertex).project(camera);
      expect(of[0]!.places[2 * i]).toBeCloseTo(LEFT + (0.5 + 0.5 * x) * WIDTH, 2);
      expect(of[0]!.places[2 * i + 1]).toBeCloseTo(TOP + (0.5 - 0.5 * y) * HEIGHT, 2);
    });
  });

  it("under a brush are near it on the body in front", () => {
    const { x, y } = new THREE.Vector3(0.03, -0.25, 0.02).project(camera);
    const middle = [LEFT + (0.5 + 0.5 * x) * WIDTH, TOP + (0.5 - 0.5 * y) * HEIGHT] as const;
    const [before, behind] = new SeenVertices([near, far], eye).where(withinStroke(middle, middle, 30));
    expect(before!.length).toBeGreaterThan(10);
    expect(behind!.length).toBe(0);
    const metresPerPixel = (2 * 0.55 * Math.tan(THREE.MathUtils.degToRad(17.5))) / HEIGHT;
    for (const vertex of before!) {
      const place = new THREE.Vector3().fromArray(near.positions, 3 * vertex);
      expect(place.distanceTo(new THREE.Vector3(0.03, -0.25, 0.02))).toBeLessThan(1.3 * 30 * metresPerPixel);
    }
  });

  it("are not what is cut away, nor hidden by it", () => {
    const open = { ...near, removed: () => true };
    const found = new SeenVertices([open, far], eye).of;
    expect(found[0]!.vertices.length).toBe(0);
    expect(found[1]!.vertices.length).toBe(new SeenVertices([far], eye).of[0]!.vertices.length);
  });
});
