// What a mechanism is made of, seen apart from how it is drawn: which markers of a link hold joints, which slides are
// telescopes (a cylinder with its rod) and which are blocks on a rail.

import { distinct, vector } from "./shapes.js";

const SLIDING = ["prismatic", "cylindrical", "screw"];
const GEARED = ["gear", "rack", "belt"]; // hold no points together
const OFF_AXIS = 0.06; // of a telescope's least length: farther away, a point is not on its axis

export class Mechanism {
  constructor({ links, joints, springs, extent }) {
    this.extent = extent;
    this.links = links.map((link) => ({
      ...link,
      markers: link.markers.map(({ name, at, axis, x }) => ({ name, at: vector(at), axis: vector(axis), x: vector(x) })),
    }));
    const withEnds = (part) => ({
      ...part,
      ends: part.links.map((link, side) => ({ link, ...this.marker(link, part.markers[side]) })),
    });
    const all = joints.map(withEnds);
    this.springs = springs.map(withEnds);
    this.joints = all.filter((joint) => !isGeared(joint));
    this.gears = all.filter(isGeared);
    this.telescopes = this.joints
      .filter(({ telescopes }) => telescopes)
      .map((joint) => this.telescope(joint))
      .filter(Boolean);
    const isTelescope = new Set(this.telescopes.map(({ joint }) => joint));
    this.rails = this.joints.filter((joint) => isSlide(joint) && !isTelescope.has(joint));
  }

  marker(link, name) {
    return this.links[link].markers.find((marker) => marker.name === name);
  }

  /** Pitch circles of a link: its end of a gear, and their radius; a worm has a thread instead. */
  wheels(link) {
    const ends = this.gears.flatMap(({ ends, radii, thread }) =>
      ends.map((end, side) => ({ ...end, radius: radii[side] })).slice(thread ? 1 : 0),
    );
    return ends
      .filter((end) => end.link === link && end.radius > 0)
      .filter((end, i, own) => own.findIndex((other) => isSameWheel(other, end, this.extent)) === i);
  }

  /** Worms of a link: its end of the gear, points along the thread, and the radius. */
  worms(link) {
    return this.gears
      .filter(({ thread, links }) => thread && links[0] === link)
      .map(({ ends, radii, thread }) => ({ ...ends[0], radius: radii[0], thread: thread.map(vector) }));
  }

  /** Cams of a link: their outlines, and whether the body is inside of them. */
  cams(link) {
    return this.joints
      .filter(({ type, links, barrel }) => type === "cam" && links[0] === link && !barrel)
      .flatMap(({ outlines, side, groove }) =>
        outlines.map((line) => ({ line: line.map(vector), isBody: side > 0 && !groove })),
      );
  }

  /** Walls of the drums of a link: from each edge of a curve to the end of the drum. */
  walls(link) {
    return this.joints
      .filter(({ type, links, barrel }) => type === "cam" && links[0] === link && barrel)
      .flatMap(({ outlines }) => outlines.map((line) => line.map(vector)))
      .flatMap((edge, i, lines) => (i % 2 ? [] : [{ edge, end: lines[i + 1] }]));
  }

  /** What rides on cams: markers of a link with a roller's radius, or with a flat face across their axis. */
  followers(link) {
    return this.joints
      .filter(({ type, links }) => type === "cam" && links[1] === link)
      .map(({ ends, radius, follower, roller_axis, face_radius }) => ({
        ...ends[1],
        radius,
        isFlat: follower === "flat",
        faceRadius: face_radius,
        turnsAbout: vector(roller_axis),
      }));
  }

  /** Pitch lines of racks, or ropes: from where they touch their wheels to the markers of their links. */
  get racks() {
    return this.gears
      .filter(({ type }) => type === "rack")
      .map(({ carrier, pitch, links, rack_end }) => ({
        isLine: true,
        ends: [
          { link: carrier, at: vector(pitch) },
          { link: links[1], at: vector(rack_end) },
        ],
      }));
  }

  /** Straight runs of the belts whose wheels a link carries: pairs of points. */
  belts(link) {
    return this.gears
      .filter(({ type, carrier }) => type === "belt" && carrier === link)
      .flatMap(({ runs }) => runs.map((run) => run.map(vector)));
  }

  /** Distinct points of a link that hold its joints, in link axes. */
  corners(link) {
    const ends = this.joints.flatMap((joint) => joint.ends).filter((end) => end.link === link);
    return distinct(
      ends.map((end) => end.at),
      1e-6 * this.extent,
    );
  }

  /** Distinct points of a link that hold no joint. */
  freePoints(link) {
    const held = this.corners(link);
    const points = this.links[link].markers.map((marker) => marker.at);
    return distinct(points, 1e-6 * this.extent).filter((point) =>
      held.every((corner) => corner.distanceTo(point) > 1e-6 * this.extent),
    );
  }

  /** Is a link drawn as half of a telescope? */
  isTelescope(link) {
    return this.telescopes.some(({ joint }) => joint.links.includes(link));
  }

  /**
   * Links that hold their joints on the axis of a driven slide, far ends that never come together, all of them on barrel
   * and rod: from base to eye, in link axes, with lengths that keep the rod's inner end in the barrel as long as the
   * stroke allows.
   */
  telescope(joint) {
    const [first, second] = joint.ends;
    const sign = Math.sign(joint.travel[0] + joint.travel[1]) || 1;
    const axis = first.axis.clone().multiplyScalar(sign),
      rodAxis = second.axis.clone().multiplyScalar(sign);
    const along = (end, direction) => this.corners(end.link).map((corner) => corner.clone().sub(end.at).dot(direction));
    const onFirst = along(first, axis),
      onSecond = along(second, rodAxis);
    const base = Math.min(...onFirst),
      eye = Math.max(...onSecond);
    const [lowest, highest] = joint.travel.map((slide) => sign * slide).sort((a, b) => a - b);
    const least = lowest + eye - base,
      most = highest + eye - base;
    if (!(least > 0.25 * most)) return null;
    const barrel = Math.min(Math.max(1.15 * most - least, 0.58 * least), 0.93 * least);
    const isOnAxis = (end, direction, point) => {
      const offset = point.clone().sub(end.at);
      return offset.addScaledVector(direction, -offset.dot(direction)).length() < OFF_AXIS * least;
    };
    const isSlim = (end, direction) => this.corners(end.link).every((point) => isOnAxis(end, direction, point));
    if (!isSlim(first, axis) || !isSlim(second, rodAxis)) return null;
    const rod = Math.min(least, most - barrel + 0.06 * least);
    if (Math.max(...onFirst) > base + barrel + OFF_AXIS * least || Math.min(...onSecond) < eye - rod - OFF_AXIS * least) return null;
    return {
      joint,
      from: first.at.clone().addScaledVector(axis, base),
      barrelTo: first.at.clone().addScaledVector(axis, base + barrel),
      to: second.at.clone().addScaledVector(rodAxis, eye),
      rodFrom: second.at.clone().addScaledVector(rodAxis, eye - rod),
    };
  }
}

function isSameWheel(a, b, extent) {
  return a.name === b.name && Math.abs(a.radius - b.radius) < 1e-6 * extent;
}

function isGeared(joint) {
  return GEARED.includes(joint.type);
}

function isSlide(joint) {
  return SLIDING.includes(joint.type);
}
