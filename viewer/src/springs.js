// Springs and dampers, and the lines of racks and ropes: coils round barrels and rods, which follow both of their ends; spirals and shoes round hinges.

import * as THREE from "three";
import { across, rod, vector } from "./shapes.js";

const COILS = 8;
const LEAD = 0.1; // straight part at either end, of the length
const WIDEST = 0.2; // radius of a coil, of its length
const BARREL = 0.55; // of the length of a damper, the rest is rod
const SPIRAL = { inner: 1.4, outer: 2.9, turns: 2.25 }; // radii in units
const LINE = 0.3; // radius of a rope or the line of a rack, in units
const SHOE = 0.6; // half the angle of a brake's shoe, rad
const SIZES = { planar: { unit: 0.0135, wire: 0.17, lift: 0.25 }, spatial: { unit: 0.011, wire: 0.28, lift: 0 } }; // of the extent; of the unit; of the extent

export class Springs {
  /** `placeOf` tells where a place [link, x, y, z] is in world axes; what turns with a hinge is put into the links' groups. */
  constructor(mechanism, links, palette, isPlanar, placeOf) {
    this.object = new THREE.Group();
    this.placeOf = placeOf;
    const size = SIZES[isPlanar ? "planar" : "spatial"];
    this.draw = { isPlanar, unit: size.unit * mechanism.extent, wire: size.wire * size.unit * mechanism.extent, palette };
    this.lift = size.lift * mechanism.extent;
    this.least = 1e-4 * mechanism.extent;
    this.stretched = [...mechanism.springs.filter(actsAlong), ...mechanism.racks].map((spring) => this.stretchedOf(spring));
    for (const spring of mechanism.springs.filter(actsRound)) this.wind(spring, links);
  }

  /** Built when its ends are first apart: as long as it is then, and stretched from then on. */
  stretchedOf(spring) {
    const group = new THREE.Group();
    this.object.add(group);
    return { spring, group, length: 0, ends: spring.ends.map(({ link, at }) => [link, ...at.toArray()]) };
  }

  build(item, length) {
    const { unit, wire, palette, isPlanar } = this.draw;
    item.length = length;
    if (item.spring.isLine) {
      item.group.add(rod(vector([0, 0, 0]), vector([0, length, 0]), LINE * unit, palette.spring));
    } else if (item.spring.damping) {
      const [start, middle, end] = [0, BARREL * length, length].map((y) => vector([0, y, 0]));
      item.group.add(rod(start, middle, 0.55 * unit, palette.barrel), rod(middle, end, 0.28 * unit, palette.edge));
    }
    if (!item.spring.isLine && pulls(item.spring)) item.group.add(coil(length, Math.min(unit * 1.2, WIDEST * length), wire, isPlanar, palette.spring));
    item.group.traverse((mesh) => {
      mesh.castShadow = !isPlanar;
    });
  }

  /** Between where its ends are now: along the y axis it was built. */
  update() {
    for (const item of this.stretched) {
      const [from, to] = item.ends.map((place) => this.placeOf(place));
      const along = to.clone().sub(from);
      const length = along.length();
      item.group.visible = length > this.least; // neither NaN
      if (!item.group.visible) continue;
      if (!item.length) this.build(item, length);
      along.divideScalar(length);
      const side = this.draw.isPlanar ? vector([along.y, -along.x, 0]) : across(along);
      const third = new THREE.Vector3().crossVectors(side, along);
      item.group.matrixAutoUpdate = false;
      item.group.matrix
        .makeBasis(side, along.multiplyScalar(length / item.length), third)
        .setPosition(from.setZ(from.z + this.lift));
      item.group.matrixWorldNeedsUpdate = true;
    }
  }

  /** A spiral that turns with the second link, shoes that stand on the first. */
  wind(spring, links) {
    const { unit, wire, palette, isPlanar } = this.draw;
    const put = ({ link, at, axis, x }, points) => {
      const normal = isPlanar ? vector([0, 0, 1]) : axis;
      const y = new THREE.Vector3().crossVectors(normal, x);
      const group = new THREE.Group().add(tube(points, wire, palette.spring));
      group.applyMatrix4(new THREE.Matrix4().makeBasis(x, y, normal).setPosition(at.clone().setZ(at.z + this.lift)));
      links[link].add(group);
    };
    if (pulls(spring)) {
      const { inner, outer, turns } = SPIRAL;
      const winding = (part) => [unit * (inner + (outer - inner) * part), 2 * Math.PI * turns * part];
      put(spring.ends[1], sampled(80, winding));
    }
    if (!spring.damping) return;
    for (const middle of [0.5 * Math.PI, 1.5 * Math.PI])
      put(spring.ends[0], sampled(15, (part) => [SPIRAL.outer * unit, middle + SHOE * (2 * part - 1)]));
  }
}

/** Between two points: of its own, or of a slide. */
function actsAlong({ joint, variable }) {
  return !joint || variable === "slide";
}

function actsRound({ joint, variable }) {
  return joint && variable === "angle";
}

function pulls({ stiffness, has_force }) {
  return stiffness !== 0 || has_force;
}

/** Wire along the y axis: a zigzag in the plane, a helix in space. */
function coil(length, radius, wire, isPlanar, material) {
  const n = isPlanar ? 2 * COILS : 20 * COILS;
  const at = (part) => length * (LEAD + (1 - 2 * LEAD) * part);
  const points = [vector([0, 0, 0]), vector([0, at(0), 0])];
  for (let i = 0; i < n; i++) {
    const part = (i + 0.5) / n,
      turn = 2 * Math.PI * COILS * part;
    const [x, z] = isPlanar ? [i % 2 ? -radius : radius, 0] : [radius * Math.cos(turn), radius * Math.sin(turn)];
    points.push(vector([x, at(part), z]));
  }
  points.push(vector([0, at(1), 0]), vector([0, length, 0]));
  return isPlanar ? bent(points, wire, material) : tube(points, wire, material);
}

/** Straight from point to point. */
function bent(points, wire, material) {
  const group = new THREE.Group();
  points.slice(1).forEach((point, i) => group.add(rod(points[i], point, wire, material)));
  return group;
}

function tube(points, wire, material) {
  return new THREE.Mesh(new THREE.TubeGeometry(new THREE.CatmullRomCurve3(points), 2 * points.length, wire, 8), material);
}

/** Points of a curve in the plane, given as radius and angle over 0 to 1. */
function sampled(n, curve) {
  return Array.from({ length: n }, (_, i) => {
    const [radius, angle] = curve(i / (n - 1));
    return vector([radius * Math.cos(angle), radius * Math.sin(angle), 0]);
  });
}
