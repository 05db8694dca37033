// Shapes of tools, in their own frame: how they are drawn, and how they stand on a surface. The origin is the point that a
// device moves: the centre of a sphere, of an ellipsoid and of the front hemisphere of a capsule, the middle of a punch's
// face. Capsule and punch lie along +z, their front towards -z.

import * as THREE from "three";
import { toCreasedNormals } from "three/addons/utils/BufferGeometryUtils.js";

import type { ToolArrays, ToolMessage } from "../net/protocol";

/** Length of a punch over its radius. */
const PUNCH_LENGTH = 4;
/** Within this sine of lying flat on a line or a plane, the place where a tool stands goes from one end to the other. */
const FLAT_SINE = 0.2;
/** Over the size of a surface: points that reach so much less far than the farthest bear a third of its share. */
const BEARING_DEPTH = 0.02;
/** Edges of a surface sharper than this are drawn as edges, rad. */
const CREASE = Math.PI / 6;
const RINGS = 24;
const SEGMENTS = 48;

export interface ToolShape {
  geometry(): THREE.BufferGeometry;
  /** How far the tool reaches from its origin in a direction of length one, m. */
  reach(direction: THREE.Vector3): number;
  /**
   * The point that stands on a surface into which a direction leads. Where a whole line or face does, it is its middle,
   * and it moves smoothly with the direction, so that a tool does not jump when it is turned.
   */
  supportPoint(direction: THREE.Vector3): THREE.Vector3;
}

/** A point of a surface, and the outward normal there. */
export interface SurfaceSpot {
  point: THREE.Vector3;
  normal: THREE.Vector3;
}

export function toolShape({ shape, lengths }: Pick<ToolMessage, "shape" | "lengths">, arrays: ToolArrays): ToolShape {
  const [first, second] = lengths;
  switch (shape) {
    case "sphere":
      return ellipsoid(new THREE.Vector3(first, first, first));
    case "ellipsoid":
      return ellipsoid(new THREE.Vector3(...lengths));
    case "capsule":
      return capsule(first, second);
    case "punch":
      return punch(first, second);
    case "surface":
      return surface(arrays);
  }
}

/** Origin of a tool whose footing stands over a spot, so deep below the tangent plane there, m. */
export function originAt(
  shape: ToolShape,
  orientation: THREE.Quaternion,
  { point, normal }: SurfaceSpot,
  depth: number,
): THREE.Vector3 {
  const direction = normal.clone().negate().applyQuaternion(orientation.clone().invert()).normalize();
  const supportPoint = shape.supportPoint(direction).applyQuaternion(orientation);
  const aside = supportPoint.addScaledVector(normal, -supportPoint.dot(normal));
  return point.clone().sub(aside).addScaledVector(normal, shape.reach(direction) - depth);
}

function ellipsoid(semiAxes: THREE.Vector3): ToolShape {
  const reach = (direction: THREE.Vector3) => direction.clone().multiply(semiAxes).length();
  return {
    geometry: () => new THREE.SphereGeometry(1, SEGMENTS, RINGS).scale(...semiAxes.toArray()),
    reach,
    // The support: where the outward normal is the direction.
    supportPoint: (direction) => direction.clone().multiply(semiAxes).multiply(semiAxes).divideScalar(reach(direction)),
  };
}

/** `length` is that of the cylinder between the hemispheres. */
function capsule(radius: number, length: number): ToolShape {
  return {
    geometry: () => alongZ(new THREE.CapsuleGeometry(radius, length, RINGS / 2, SEGMENTS)).translate(0, 0, length / 2),
    reach: ({ z }) => radius + Math.max(0, z * length),
    supportPoint: (direction) => direction.clone().multiplyScalar(radius).add(new THREE.Vector3(0, 0, length * behind(direction.z))),
  };
}

function punch(radius: number, rounding: number): ToolShape {
  const [length, flat] = [PUNCH_LENGTH * radius, radius - rounding];
  const rim = (turn: number): [number, number] => [flat + rounding * Math.sin(turn), rounding * Math.cos(turn)];
  return {
    geometry: () => {
      const corner = Array.from({ length: RINGS / 2 + 1 }, (_, i) => rim(((i / (RINGS / 2)) * Math.PI) / 2));
      const profile = [
        [0, 0],
        ...corner.map(([across, down]) => [across, rounding - down]),
        ...corner.map(([across, up]) => [across, length - rounding + up]).reverse(),
        [0, length],
      ];
      return alongZ(new THREE.LatheGeometry(profile.map(([x, y]) => new THREE.Vector2(x, y)), SEGMENTS));
    },
    // All points lie `rounding` from a smaller cylinder with sharp edges.
    reach: ({ x, y, z }) =>
      rounding + flat * Math.hypot(x, y) + (z > 0 ? z * (length - rounding) : z * rounding),
    supportPoint: ({ x, y, z }) => {
      const across = (flat / Math.max(FLAT_SINE, Math.hypot(x, y))) + rounding;
      const along = rounding + (length - 2 * rounding) * behind(z) + rounding * z;
      return new THREE.Vector3(across * x, across * y, along);
    },
  };
}

function surface({ vertices, triangles }: ToolArrays): ToolShape {
  const places = Array.from({ length: vertices.length / 3 }, (_, i) => new THREE.Vector3().fromArray(vertices, 3 * i));
  const size = new THREE.Box3().setFromPoints(places).getSize(new THREE.Vector3()).length();
  const reach = (direction: THREE.Vector3) => places.reduce((far, place) => Math.max(far, place.dot(direction)), -Infinity);
  return {
    geometry: () => {
      const whole = new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(vertices, 3));
      return toCreasedNormals(whole.setIndex(new THREE.BufferAttribute(triangles, 1)), CREASE);
    },
    reach,
    supportPoint: (direction) => {
      const [farthest, sum] = [reach(direction), new THREE.Vector3()];
      let shares = 0;
      for (const place of places) {
        const share = Math.exp((place.dot(direction) - farthest) / (BEARING_DEPTH * size));
        sum.addScaledVector(place, share);
        shares += share;
      }
      return sum.divideScalar(shares);
    },
  };
}

/** From shapes along y to those along z. */
function alongZ<Geometry extends THREE.BufferGeometry>(geometry: Geometry): Geometry {
  return geometry.rotateX(Math.PI / 2);
}

/** How far from the front to the back end of a rod it stands, from 0 to 1, by the axial part of the direction. */
function behind(axial: number): number {
  return (1 + THREE.MathUtils.clamp(axial / FLAT_SINE, -1, 1)) / 2;
}
