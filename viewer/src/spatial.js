// A spatial mechanism: rods between joints, plates where more than two joints lie in a plane, cylinders with their rods,
// posts under what stands on the frame, and a body for each kind of joint.

import * as THREE from "three";
import { ball, centreOf, rod, roundHull, turnTo } from "./shapes.js";

const ROD = 0.011; // radius, of the mechanism's extent
const FLAT = 2.5; // rods: farther from their plane, joints do not lie on a plate

/** Groups of meshes in link axes, one a link; 0 is the frame. `ground` is the height of the ground along `up`. */
export function drawSpatial(mechanism, palette, { up, ground }) {
  const unit = ROD * mechanism.extent;
  const groups = mechanism.links.map((_, k) => {
    const group = new THREE.Group();
    if (k === 0) drawFrame(group, mechanism, palette, unit, up, ground);
    else drawLink(group, mechanism, k, palette.link(k).solid, unit);
    return group;
  });
  for (const telescope of mechanism.telescopes) drawTelescope(groups, telescope, palette, unit);
  for (const rail of mechanism.rails) drawRail(groups, rail, palette, unit);
  for (const joint of mechanism.joints) if (joint.type === "planar") drawTable(groups, joint, palette, unit);
  for (const joint of mechanism.joints) drawJoint(groups, joint, palette, unit);
  groups.forEach((group, k) => drawWheels(group, mechanism, k, palette, unit));
  groups.forEach((group, k) => drawCams(group, mechanism, k, palette, unit));
  for (const group of groups) {
    group.traverse((mesh) => {
      mesh.castShadow = mesh.receiveShadow = true;
    });
  }
  return groups;
}

function drawLink(group, mechanism, k, material, unit) {
  const corners = mechanism.isTelescope(k) ? [] : mechanism.corners(k);
  const plane = corners.length > 2 ? planeThrough(corners, unit) : null;
  if (plane) group.add(plate(corners, plane, 1.6 * unit, 0.7 * unit, material));
  else if (corners.length === 2) group.add(rod(...corners, unit, material));
  else if (corners.length > 2) {
    const centre = centreOf(corners.map((corner) => corner.clone()));
    for (const corner of corners) group.add(rod(centre, corner, unit, material));
    group.add(ball(centre, 1.2 * unit, material));
  }
  drawFreePoints(group, mechanism, k, material, unit);
}

/** Thin stems from the body to points that hold no joint: tools, loads. */
function drawFreePoints(group, mechanism, k, material, unit) {
  const corners = mechanism.corners(k);
  for (const point of mechanism.freePoints(k)) {
    group.add(ball(point, 0.75 * unit, material));
    if (k !== 0 && corners.length) group.add(rod(footOf(point, corners, unit), point, 0.3 * unit, material));
  }
}

/** Where the stem of a point begins: below it on the plate, else at the middle of the joints. */
function footOf(point, corners, unit) {
  const centre = centreOf(corners.map((corner) => corner.clone()));
  const plane = corners.length > 2 ? planeThrough(corners, unit) : null;
  if (!plane) return centre;
  const below = point.clone().addScaledVector(plane.normal, -point.clone().sub(plane.centre).dot(plane.normal));
  const reach = Math.min(...corners.map((corner) => corner.distanceTo(centre)));
  return below.distanceTo(centre) < 0.8 * reach ? below : centre;
}

/** Centre and axes of the plane that the points lie in, or null. */
function planeThrough(points, unit) {
  const centre = centreOf(points.map((point) => point.clone()));
  const offsets = points.map((point) => point.clone().sub(centre));
  const first = offsets
    .reduce((a, b) => (b.lengthSq() > a.lengthSq() ? b : a))
    .clone()
    .normalize();
  const normals = offsets.map((offset) => new THREE.Vector3().crossVectors(first, offset));
  const normal = normals.reduce((a, b) => (b.lengthSq() > a.lengthSq() ? b : a)).clone();
  if (normal.length() < unit) return null;
  normal.normalize();
  if (offsets.some((offset) => Math.abs(offset.dot(normal)) > FLAT * unit)) return null;
  return { centre, normal, first, second: new THREE.Vector3().crossVectors(normal, first) };
}

function plate(corners, { centre, normal, first, second }, radius, half, material) {
  const flat = corners.map((corner) => {
    const offset = corner.clone().sub(centre);
    return new THREE.Vector2(offset.dot(first), offset.dot(second));
  });
  const bevel = 0.3 * half;
  const geometry = new THREE.ExtrudeGeometry(roundHull(flat, radius - bevel), {
    depth: 2 * (half - bevel),
    bevelSize: bevel,
    bevelThickness: bevel,
    bevelSegments: 3,
    curveSegments: 20,
  });
  const mesh = new THREE.Mesh(geometry.translate(0, 0, -half + bevel), material);
  mesh.applyMatrix4(new THREE.Matrix4().makeBasis(first, second, normal).setPosition(centre));
  return mesh;
}

/** A base plate if the joints of the frame lie in one level plane near the ground; a post under each otherwise. */
function drawFrame(group, mechanism, palette, unit, up, ground) {
  const corners = mechanism.corners(0);
  const plane = corners.length > 2 ? planeThrough(corners, unit) : null;
  const height = (point) => point.dot(up) - ground;
  if (plane && Math.abs(plane.normal.dot(up)) > 0.999 && height(plane.centre) < 12 * unit) {
    const lowered = { ...plane, centre: plane.centre.clone().addScaledVector(up, -1.6 * unit) };
    group.add(
      plate(
        corners.map((corner) => corner.clone().addScaledVector(up, -1.6 * unit)),
        lowered,
        3.2 * unit,
        unit,
        palette.frame,
      ),
    );
    for (const corner of corners) group.add(rod(corner.clone().addScaledVector(up, -unit), corner, 1.5 * unit, palette.frame));
  } else {
    for (const corner of corners) {
      const foot = corner.clone().addScaledVector(up, -Math.max(height(corner), 2 * unit));
      group.add(rod(foot, corner, 1.5 * unit, palette.frame, 1.0 * unit));
      group.add(rod(foot, foot.clone().addScaledVector(up, 0.8 * unit), 3.2 * unit, palette.frame));
    }
  }
  drawFreePoints(group, mechanism, 0, palette.frame, unit);
}

function drawTelescope(groups, { joint, from, barrelTo, rodFrom, to }, palette, unit) {
  const [first, second] = joint.links;
  const collar = barrelTo.clone().lerp(from, (2.2 * unit) / Math.max(from.distanceTo(barrelTo), 1e-9));
  groups[first].add(rod(from, barrelTo, 1.9 * unit, palette.barrel), rod(collar, barrelTo, 2.2 * unit, palette.barrel));
  groups[second].add(rod(rodFrom, to, 0.95 * unit, palette.rod));
  if (joint.type === "screw") drawThread(groups[second], rodFrom, to, unit, palette.rod);
}

/** The rail on the first link as long as the travel, the sleeve on the second. */
function drawRail(groups, joint, palette, unit) {
  const [first, second] = joint.ends;
  const end = (slide) => first.at.clone().addScaledVector(first.axis, slide);
  const [lowest, highest] = joint.travel;
  const sides = { cylindrical: 28, screw: 6 }[joint.type]; // a bush, a nut
  const material = first.link === 0 ? palette.frame : palette.rod;
  const [from, to] = [end(Math.min(0, lowest) - 3 * unit), end(Math.max(0, highest) + 3 * unit)];
  groups[first.link].add(rod(from, to, 0.8 * unit, material));
  if (joint.type === "screw") drawThread(groups[first.link], from, to, unit, material);
  const body = second.link === 0 ? palette.barrel : palette.link(second.link).solid;
  const shape = sides
    ? new THREE.CylinderGeometry(1.9 * unit, 1.9 * unit, 5.5 * unit, sides)
    : new THREE.BoxGeometry(3.4 * unit, 5.5 * unit, 3.4 * unit);
  const sleeve = new THREE.Mesh(shape, body);
  sleeve.position.copy(second.at);
  sleeve.quaternion.copy(turnTo(second.axis));
  groups[second.link].add(sleeve);
}

/** Rings on a rod: enough to be seen as a thread, never so many that they take time. */
function drawThread(group, from, to, unit, material) {
  const n = Math.min(80, Math.ceil(from.distanceTo(to) / (1.1 * unit)));
  for (let k = 1; k < n; k++) {
    const ring = new THREE.Mesh(new THREE.TorusGeometry(0.85 * unit, 0.28 * unit, 8, 20), material);
    ring.position.copy(from).lerp(to, k / n);
    ring.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), to.clone().sub(from).normalize());
    group.add(ring);
  }
}

/** Pitch circles as rings with spokes, worms, and the runs of belts. */
function drawWheels(group, mechanism, k, palette, unit) {
  const material = k === 0 ? palette.frame : palette.link(k).solid;
  for (const { at, axis, x, radius } of mechanism.wheels(k)) {
    const ring = new THREE.Mesh(new THREE.TorusGeometry(radius, Math.min(0.7 * unit, 0.2 * radius), 12, 128), material);
    ring.position.copy(at);
    ring.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), axis.clone().normalize());
    group.add(ring);
    if (k === 0) continue;
    for (let i = 0; i < 3; i++) {
      const spoke = x.clone().applyAxisAngle(axis, (2 * Math.PI * i) / 3);
      group.add(rod(at, at.clone().addScaledVector(spoke, radius), 0.4 * unit, material));
    }
  }
  for (const { at, axis, radius, thread } of mechanism.worms(k)) {
    const ends = [thread[0], thread.at(-1)].map((end) => end.clone().sub(at).dot(axis));
    const [from, to] = ends.map((end) => at.clone().addScaledVector(axis, end));
    const [low, high] = [Math.min(0, ...ends), Math.max(0, ...ends)].map((end) => at.clone().addScaledVector(axis, end));
    group.add(rod(from, to, 0.8 * radius, material), rod(low, high, Math.min(unit, 0.5 * radius), material)); // core and shaft
    const line = new THREE.CatmullRomCurve3(thread);
    group.add(new THREE.Mesh(new THREE.TubeGeometry(line, 3 * thread.length, 0.25 * radius, 8), material));
  }
  for (const [from, to] of mechanism.belts(k)) group.add(rod(from, to, 0.35 * unit, palette.spring));
}

/** Two plates bolted together, square to the marker's axis. */
function flange({ at, axis }, unit, palette) {
  const plates = new THREE.Mesh(new THREE.BoxGeometry(4.2 * unit, 1.4 * unit, 4.2 * unit), palette.joint);
  plates.position.copy(at);
  plates.quaternion.copy(turnTo(axis));
  return plates;
}

/** The plate that a planar joint slides on, as large as its travel, and a puck on it. */
function drawTable(groups, { ends: [first, second], field }, palette, unit) {
  const [[left, right], [near, far]] = field;
  const y = new THREE.Vector3().crossVectors(first.axis, first.x);
  const shape = new THREE.BoxGeometry(right - left + 8 * unit, far - near + 8 * unit, unit);
  const table = new THREE.Mesh(shape, first.link === 0 ? palette.frame : palette.link(first.link).solid);
  const centre = first.at
    .clone()
    .addScaledVector(first.x, (left + right) / 2)
    .addScaledVector(y, (near + far) / 2)
    .addScaledVector(first.axis, -0.5 * unit);
  table.applyMatrix4(new THREE.Matrix4().makeBasis(first.x, y, first.axis).setPosition(centre));
  groups[first.link].add(table);
  const top = second.at.clone().addScaledVector(second.axis, 1.2 * unit);
  groups[second.link].add(rod(second.at, top, 2.6 * unit, palette.joint));
}

/** Outlines of cams, discs and drums; rollers as rings, flat faces as plates. */
function drawCams(group, mechanism, k, palette, unit) {
  const material = k === 0 ? palette.frame : palette.link(k).solid;
  const wall = material.clone();
  wall.side = THREE.DoubleSide;
  for (const { line, isBody } of mechanism.cams(k)) {
    group.add(closedTube(line, 0.4 * unit, material));
    const plane = isBody ? planeThrough(line, unit) : null;
    if (plane) group.add(disc(line, plane, 0.4 * unit, material));
  }
  for (const { edge, end } of mechanism.walls(k)) {
    group.add(closedTube(edge, 0.4 * unit, material), closedTube(end, 0.4 * unit, material), loft(edge, end, wall));
  }
  for (const { at, axis, radius, turnsAbout, isFlat, faceRadius } of mechanism.followers(k)) {
    if (isFlat) group.add(rod(at, at.clone().addScaledVector(axis, -0.4 * unit), faceRadius, material));
    if (!(radius > 0)) continue;
    const half = turnsAbout.clone().multiplyScalar(Math.min(0.8 * unit, 0.5 * radius));
    group.add(rod(at.clone().sub(half), at.clone().add(half), radius, material));
  }
}

function closedTube(line, radius, material) {
  return new THREE.Mesh(new THREE.TubeGeometry(new THREE.CatmullRomCurve3(line, true), line.length, radius, 8, true), material);
}

/** What a flat closed line goes round, as a thin plate. */
function disc(line, { centre, normal, first, second }, half, material) {
  const flat = line.map((point) => {
    const offset = point.clone().sub(centre);
    return new THREE.Vector2(offset.dot(first), offset.dot(second));
  });
  const geometry = new THREE.ExtrudeGeometry(new THREE.Shape(flat), { depth: 2 * half, bevelEnabled: false });
  const mesh = new THREE.Mesh(geometry.translate(0, 0, -half), material);
  mesh.applyMatrix4(new THREE.Matrix4().makeBasis(first, second, normal).setPosition(centre));
  return mesh;
}

/** The surface between two closed lines of as many points. */
function loft(from, to, material) {
  const n = from.length;
  const geometry = new THREE.BufferGeometry().setFromPoints([...from, ...to]);
  geometry.setIndex(
    from.flatMap((_, i) => {
      const next = (i + 1) % n;
      return [i, next, n + i, next, n + next, n + i];
    }),
  );
  geometry.computeVertexNormals();
  return new THREE.Mesh(geometry, material);
}

function drawJoint(groups, { type, ends }, palette, unit) {
  const [first, second] = ends;
  const pin = ({ link, at, axis }, half, radius) =>
    groups[link].add(rod(at.clone().addScaledVector(axis, -half), at.clone().addScaledVector(axis, half), radius, palette.joint));
  if (type === "revolute") pin(second, 2.4 * unit, 1.5 * unit);
  if (type === "fixed") groups[second.link].add(flange(second, unit, palette));
  if (type === "spherical") groups[second.link].add(ball(second.at, 1.9 * unit, palette.joint));
  if (type === "universal") {
    pin(first, 2.4 * unit, 0.8 * unit);
    pin(second, 2.4 * unit, 0.8 * unit);
    groups[second.link].add(ball(second.at, 1.5 * unit, palette.joint));
  }
}
