// Geometry that planar and spatial drawings share: points of a link, hulls with round corners, rods.

import * as THREE from "three";

const UP = new THREE.Vector3(0, 1, 0);

export const vector = (values) => new THREE.Vector3(...values);

/** The points without repetitions. */
export function distinct(points, tolerance) {
  return points.filter((point, i) => points.findIndex((other) => other.distanceTo(point) <= tolerance) === i);
}

export function centreOf(points) {
  return points.reduce((sum, point) => sum.add(point), new THREE.Vector3()).divideScalar(points.length);
}

/** Corners of the convex hull of points in the plane, counterclockwise (Andrew's monotone chain). */
export function hullOf(points) {
  const sorted = [...points].sort((a, b) => a.x - b.x || a.y - b.y);
  const turn = (a, b, c) => (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
  const half = (ordered) => {
    const chain = [];
    for (const point of ordered) {
      while (chain.length > 1 && turn(chain.at(-2), chain.at(-1), point) <= 0) chain.pop();
      chain.push(point);
    }
    return chain.slice(0, -1);
  };
  return [...half(sorted), ...half(sorted.reverse())];
}

/** All that is nearer than a radius to the convex hull of points in the plane: a disc, a bar with round ends, a plate. */
export function roundHull(points, radius) {
  const corners = points.length > 1 ? hullOf(points) : points;
  const shape = new THREE.Shape();
  if (corners.length === 1) return shape.absarc(corners[0].x, corners[0].y, radius, 0, 2 * Math.PI);
  corners.forEach((corner, i) => {
    const before = corners.at(i - 1),
      after = corners[(i + 1) % corners.length];
    const normal = (a, b) => Math.atan2(-(b.x - a.x), b.y - a.y); // of the edge, outwards
    const first = normal(before, corner);
    let last = normal(corner, after);
    if (last < first) last += 2 * Math.PI;
    shape.absarc(corner.x, corner.y, radius, first, last, false); // joined to the one before by a straight edge
  });
  return shape.closePath();
}

/** Rotation that takes the y axis, along which three.js builds cylinders, to a direction. */
export function turnTo(direction) {
  return new THREE.Quaternion().setFromUnitVectors(UP, direction.clone().normalize());
}

/** A cylinder between two points, or a cone frustum if the radii differ. */
export function rod(from, to, radius, material, endRadius = radius) {
  const along = to.clone().sub(from);
  const mesh = new THREE.Mesh(new THREE.CylinderGeometry(endRadius, radius, Math.max(along.length(), 1e-9), 24), material);
  mesh.position.copy(from).addScaledVector(along, 0.5);
  if (along.length() > 0) mesh.quaternion.copy(turnTo(along));
  return mesh;
}

export function ball(at, radius, material) {
  const mesh = new THREE.Mesh(new THREE.SphereGeometry(radius, 28, 18), material);
  mesh.position.copy(at);
  return mesh;
}

/** A direction across another. */
export function across(direction) {
  const other = Math.abs(direction.z) < 0.9 ? new THREE.Vector3(0, 0, 1) : new THREE.Vector3(1, 0, 0);
  return new THREE.Vector3().crossVectors(direction, other).normalize();
}
