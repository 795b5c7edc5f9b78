// A planar mechanism as a textbook draws it: bars and plates with round ends, white pivots, hatched ground, blocks on rails.

import * as THREE from "three";
import { distinct, roundHull, vector } from "./shapes.js";

const BAR = 0.0135; // half the width of a bar, of the mechanism's extent
const EDGE = 0.2; // of that
const LAYER = 1e-3; // distance of links in front of each other, of the extent
const BEHIND = 0.07; // how far behind its rim a wheel's disc lies, of its radius; ways of points lie farther
const ROUND = 64; // pieces of half a wheel's rim

/** Groups of meshes in link axes, one a link; 0 is the frame. */
export function drawPlanar(mechanism, palette) {
  const unit = BAR * mechanism.extent;
  const layer = LAYER * mechanism.extent;
  return mechanism.links.map((_, k) => {
    const group = new THREE.Group();
    if (k === 0) drawGround(group, mechanism, palette, unit, layer);
    else drawLink(group, mechanism, k, palette, unit, layer);
    drawWheels(group, mechanism, k, palette, unit, layer);
    drawCams(group, mechanism, k, palette, unit, layer);
    return group;
  });
}

function flat(shape, material, z, segments = 16) {
  const mesh = new THREE.Mesh(new THREE.ShapeGeometry(shape, segments), material);
  mesh.position.z = z;
  return mesh;
}

/** A shape with a dark edge: two of it, one a little larger behind the other. */
function edged(group, outline, width, edge, fill, edgeMaterial, z, step) {
  group.add(flat(outline(width + edge), edgeMaterial, z), flat(outline(width - edge), fill, z + step));
}

function drawLink(group, mechanism, k, palette, unit, layer) {
  const z = 2 * k * layer,
    edge = EDGE * unit;
  const colours = palette.link(k);
  const corners = mechanism.corners(k),
    free = mechanism.freePoints(k);
  const everything = [...corners, ...free];
  if (free.length && everything.length > 1) group.add(flat(roundHull(everything, 0.45 * unit), colours.pale, z - 0.5 * layer));
  if (!mechanism.isTelescope(k) && (corners.length > 1 || (corners.length && !free.length))) {
    edged(group, (width) => roundHull(corners, width), unit, edge, colours.fill, colours.edge, z, layer);
  }
  for (const point of free) group.add(flat(roundHull([point], 0.45 * unit), colours.solid, z + 1.2 * layer));
  const front = 2 * layer * mechanism.links.length; // cylinders before the links, pins before the cylinders
  for (const telescope of mechanism.telescopes) {
    const isBarrel = telescope.joint.links[0] === k;
    if (!telescope.joint.links.includes(k)) continue;
    const [from, to] = isBarrel ? [telescope.from, telescope.barrelTo] : [telescope.rodFrom, telescope.to];
    const width = (isBarrel ? 1.5 : 0.75) * unit;
    const fill = isBarrel ? palette.barrel : palette.rod;
    edged(
      group,
      (half) => bar(from, to, half, width),
      width,
      edge,
      fill,
      palette.edge,
      front + (isBarrel ? layer : 0),
      0.5 * layer,
    );
  }
  for (const rail of mechanism.rails) drawSlide(group, mechanism, rail, k, colours, palette, unit, layer);
  for (const joint of mechanism.joints) {
    if (joint.links[1] !== k) continue;
    if (joint.type === "revolute") drawPivot(group, joint.ends[1].at, palette, unit, front + 3 * layer);
    if (joint.type === "fixed") drawWeld(group, joint.ends[1].at, palette, unit, front + 3 * layer);
  }
}

/** Pitch circles with a spoke, before all links; their discs behind these, the smaller before the larger; and the runs of belts. */
function drawWheels(group, mechanism, k, palette, unit, layer) {
  const colours = palette.link(k);
  const front = 2 * layer * mechanism.links.length;
  const z = front - 0.8 * layer;
  for (const { at, x, radius } of mechanism.wheels(k)) {
    const behind = -2 * layer - BEHIND * Math.min(radius, mechanism.extent);
    const ring = roundHull([at], radius + 0.14 * unit);
    ring.holes.push(roundHull([at], radius - 0.14 * unit));
    if (k !== 0) {
      group.add(flat(roundHull([at], radius), colours.pale, behind, ROUND));
      const spoke = bar(at, at.clone().addScaledVector(x, radius), 0.14 * unit, 0);
      group.add(flat(spoke, colours.solid, z + 0.1 * layer));
    }
    group.add(flat(ring, colours.solid, z + 0.2 * layer, ROUND));
  }
  for (const [from, to] of mechanism.belts(k)) group.add(flat(bar(from, to, 0.22 * unit, 0), palette.spring, front));
}

/** Outlines of cams; rollers and faces that ride on them. */
function drawCams(group, mechanism, k, palette, unit, layer) {
  const colours = palette.link(k);
  const z = (2 * k - 0.9) * layer;
  for (const { line, isBody } of mechanism.cams(k)) {
    if (isBody) group.add(flat(loop(line, 0), colours.pale, z));
    const ring = loop(line, 0.14 * unit);
    ring.holes.push(loop(line, -0.14 * unit));
    group.add(flat(ring, colours.solid, z + 0.2 * layer));
  }
  for (const { at, axis, radius, isFlat, faceRadius } of mechanism.followers(k)) {
    if (radius > 0) {
      edged(group, (width) => roundHull([at], width), radius - 0.1 * unit, 0.1 * unit, colours.fill, colours.edge, z, 0.1 * layer);
    }
    if (isFlat) {
      const along = vector([-axis.y, axis.x, 0]).multiplyScalar(faceRadius);
      group.add(flat(bar(at.clone().sub(along), at.clone().add(along), 0.3 * unit), colours.solid, z));
    }
  }
}

/** A closed line as a shape, a little outwards of it. */
function loop(line, off) {
  const points = line.map((point, i) => {
    const next = line[(i + 1) % line.length],
      before = line[(i + line.length - 1) % line.length];
    const outward = new THREE.Vector2(next.y - before.y, before.x - next.x).normalize();
    return new THREE.Vector2(point.x, point.y).addScaledVector(outward, off);
  });
  return new THREE.Shape(points);
}

function drawPivot(group, at, palette, unit, z) {
  edged(group, (width) => roundHull([at], width), 0.7 * unit, 0.13 * unit, palette.pivot, palette.edge, z, 0.1 * unit);
}

/** A dark square: what it holds does not turn. */
function drawWeld(group, at, palette, unit, z) {
  const side = vector([0.8 * unit, 0, 0]);
  group.add(flat(bar(at.clone().sub(side), at.clone().add(side), 0.8 * unit), palette.edge, z));
}

/** The rail on the first link of a slide, the block on its second; a block on the frame slides along a rod instead. */
function drawSlide(group, mechanism, joint, k, colours, palette, unit, layer) {
  const [first, second] = joint.ends;
  const isInverted = second.link === 0; // the block stands, the rod moves through it
  if (first.link === k) {
    const [lowest, highest] = joint.travel;
    const end = (slide) => first.at.clone().addScaledVector(first.axis, slide);
    const shape = bar(end(Math.min(0, lowest) - 3 * unit), end(highest + 3 * unit), 0.42 * unit);
    group.add(flat(shape, isInverted || k !== 0 ? colours.solid : palette.groundLine, k === 0 ? -layer : layer * k));
  }
  if (second.link === k) {
    const held = mechanism.corners(k).map((corner) => corner.clone().sub(second.at).dot(second.axis)); // the block holds them all
    const [from, to] = [
      Math.min(-2.6 * unit, ...held.map((a) => a - 1.5 * unit)),
      Math.max(2.6 * unit, ...held.map((a) => a + 1.5 * unit)),
    ];
    const end = (a) => second.at.clone().addScaledVector(second.axis, a);
    edged(
      group,
      (half) => bar(end(from), end(to), half, 1.5 * unit),
      1.5 * unit,
      EDGE * unit,
      k === 0 ? palette.barrel : colours.fill,
      palette.edge,
      2 * k * layer + 0.4 * layer,
      0.2 * layer,
    );
  }
}

/** A straight bar without round ends, longer at both by as much as it is wider than `width`. */
function bar(from, to, half, width = half) {
  const along = to.clone().sub(from).normalize();
  const side = vector([-along.y, along.x, 0]).multiplyScalar(half);
  along.multiplyScalar(half - width);
  const [first, last] = [from.clone().sub(along), to.clone().add(along)];
  const corners = [first.clone().add(side), first.clone().sub(side), last.clone().sub(side), last.clone().add(side)];
  return new THREE.Shape(corners.map(({ x, y }) => new THREE.Vector2(x, y)));
}

function drawGround(group, mechanism, palette, unit, layer) {
  const frame = mechanism.joints
    .flatMap((joint) => joint.ends.map((end, side) => ({ joint, side, ...end })))
    .filter((end) => end.link === 0);
  const pivots = distinct(
    frame.filter(({ joint }) => joint.type !== "prismatic").map((end) => end.at),
    1e-6 * mechanism.extent,
  );
  const feet = pivots.map((at) => ({ at, normal: new THREE.Vector2(0, -1), half: 2.6 * unit, from: 2.3 * unit }));
  for (const pivot of pivots) {
    const [left, right] = [-1, 1].map((sign) => vector([pivot.x + sign * 1.7 * unit, pivot.y - 2.3 * unit, 0]));
    edged(
      group,
      (half) => roundHull([pivot, left, right], half),
      0.3 * unit,
      EDGE * unit,
      palette.frame,
      palette.edge,
      -layer,
      0.3 * layer,
    );
  }
  for (const { joint, side, at, axis } of frame.filter(({ joint }) => mechanism.rails.includes(joint))) {
    drawSlide(group, mechanism, joint, 0, palette.link(0), palette, unit, layer);
    if (side === 1) continue;
    const [lowest, highest] = [Math.min(0, joint.travel[0]), joint.travel[1]];
    const normal = new THREE.Vector2(axis.y, -axis.x);
    if (normal.y > 0) normal.negate();
    feet.push({
      at: at.clone().addScaledVector(axis, (lowest + highest) / 2),
      normal,
      half: (highest - lowest) / 2 + 3 * unit,
      from: 0.42 * unit,
    });
  }
  for (const foot of feet) group.add(hatching(foot, palette, unit));
}

/** A line with strokes below it. */
function hatching({ at, normal, half, from }, palette, unit) {
  const along = new THREE.Vector2(-normal.y, normal.x);
  const place = (a, n) => vector([at.x + along.x * a + normal.x * n, at.y + along.y * a + normal.y * n, 0]);
  const points = [place(-half, from), place(half, from)];
  const n = Math.max(3, Math.round((2 * half) / (0.75 * unit)));
  for (let i = 0; i <= n; i++) {
    const a = -half + (2 * half * i) / n;
    points.push(place(a, from), place(a - 0.5 * unit, from + 0.8 * unit));
  }
  const lines = new THREE.LineSegments(new THREE.BufferGeometry().setFromPoints(points), palette.hatching);
  lines.position.z = -0.5 * unit;
  return lines;
}
