// Forces as arrows, all to one scale; torques as arcs (planar) or arrows with two heads (spatial), to another.

import * as THREE from "three";
import { frameOf } from "./data.js";
import { turnTo } from "./shapes.js";

const LONGEST = 0.27; // of the mechanism's extent
const THICK = 0.006; // radius of a shaft, of the extent
const HEAD = { length: 5.5, radius: 2.6 }; // in radii of the shaft
const LEAST = 0.25; // of a head's length: shorter arrows are not drawn
const ARC = { radius: 0.05, least: 0.02, most: 1.5 * Math.PI }; // of the extent; part of the largest; rad for that

export class Arrows {
  constructor(run, palette, pointOf) {
    this.run = run;
    this.pointOf = pointOf;
    this.magnify = 1;
    this.object = new THREE.Group();
    this.layers = run.arrows.map((entry) => {
      const n = entry.at.length;
      const isArc = entry.torque && run.planar;
      const layer = isArc ? new Arcs(n, palette[entry.kind]) : new Straight(n, palette[entry.kind], run.planar, entry.torque);
      this.object.add(layer.object);
      return { entry, layer, array: run.arrays[entry.values] };
    });
    this.largest = (torque) =>
      Math.max(0, ...run.arrows.filter((entry) => entry.torque === torque).map((entry) => entry.largest));
  }

  /** Metres of arrow for one newton, or one newton metre. */
  scale(torque) {
    const largest = this.largest(torque);
    return largest > 0 ? (this.magnify * LONGEST * this.run.extent) / largest : 0;
  }

  show(kind, isShown) {
    for (const { entry, layer } of this.layers) if (entry.kind === kind) layer.object.visible = isShown;
  }

  update(frame) {
    const value = new THREE.Vector3();
    for (const { entry, layer, array } of this.layers) {
      const values = frameOf(array, frame);
      layer.begin(this.run.extent, Math.sqrt(this.magnify));
      entry.at.forEach((place, i) => {
        value.fromArray(values, 3 * i);
        if (Number.isFinite(value.lengthSq()))
          layer.put(this.pointOf(place), value, this.scale(entry.torque), this.largest(entry.torque));
      });
      layer.end();
    }
  }

  /** Arrows and arcs that can be seen. */
  get count() {
    return this.layers.reduce((sum, { layer }) => sum + (layer.object.visible ? layer.count : 0), 0);
  }
}

/** Straight arrows; faint where a body hides them, so that a force inside a cylinder is seen too. */
class Straight {
  constructor(n, colour, isPlanar, isDouble) {
    this.isPlanar = isPlanar;
    this.heads = isDouble ? 2 : 1;
    this.object = new THREE.Group();
    const shaft = new THREE.CylinderGeometry(1, 1, 1, 16).translate(0, 0.5, 0);
    const head = new THREE.ConeGeometry(1, 1, 20).translate(0, -0.5, 0); // its tip at the origin
    const solid = isPlanar
      ? new THREE.MeshBasicMaterial({ color: colour, depthTest: false })
      : new THREE.MeshStandardMaterial({ color: colour, roughness: 0.6, emissive: colour, emissiveIntensity: 0.35 });
    const hidden = new THREE.MeshBasicMaterial({
      color: colour,
      transparent: true,
      opacity: 0.4,
      depthFunc: THREE.GreaterDepth,
      depthWrite: false,
    });
    const materials = isPlanar ? [solid] : [hidden, solid];
    this.shafts = materials.map((material) => new THREE.InstancedMesh(shaft, material, n));
    this.tips = materials.map((material) => new THREE.InstancedMesh(head, material, n * this.heads));
    for (const mesh of [...this.shafts, ...this.tips]) {
      mesh.frustumCulled = false;
      mesh.renderOrder = 10;
      this.object.add(mesh);
    }
  }

  begin(extent, widen) {
    this.radius = THICK * extent * widen;
    this.lift = this.isPlanar ? 0.3 * extent : 0; // before everything that is flat
    this.count = 0;
  }

  put(start, value, scale) {
    const length = value.length() * scale;
    const headLength = Math.min(HEAD.length * this.radius, 0.6 * length);
    if (length < LEAST * HEAD.length * this.radius) return;
    const direction = value.clone().normalize();
    const turn = turnTo(direction);
    const thick = this.radius * Math.min(1, headLength / (HEAD.length * this.radius) + 0.35);
    const from = start.clone().setZ(start.z + this.lift);
    const matrix = new THREE.Matrix4();
    matrix.compose(from, turn, new THREE.Vector3(thick, length - headLength, thick));
    for (const mesh of this.shafts) mesh.setMatrixAt(this.count, matrix);
    for (let i = 0; i < this.heads; i++) {
      const tip = from.clone().addScaledVector(direction, length - 0.7 * i * headLength);
      matrix.compose(tip, turn, new THREE.Vector3(thick * HEAD.radius, headLength, thick * HEAD.radius));
      for (const mesh of this.tips) mesh.setMatrixAt(this.count * this.heads + i, matrix);
    }
    this.count++;
  }

  end() {
    for (const mesh of [...this.shafts, ...this.tips]) {
      mesh.count = this.count * (this.tips.includes(mesh) ? this.heads : 1);
      mesh.instanceMatrix.needsUpdate = true;
    }
  }
}

/** Torques in the plane: an arc up to three quarters of a turn, with a head. */
class Arcs {
  constructor(n, colour) {
    this.object = new THREE.Group();
    this.material = new THREE.MeshBasicMaterial({ color: colour, side: THREE.DoubleSide, depthTest: false });
  }

  begin(extent, widen) {
    for (const mesh of this.object.children) mesh.geometry.dispose();
    this.object.clear();
    this.radius = ARC.radius * extent * widen;
    this.thick = THICK * extent * widen;
    this.count = 0;
  }

  put(start, value, scale, largest) {
    const part = largest > 0 ? value.z / largest : 0;
    if (Math.abs(part) < ARC.least) return;
    const swing = part * ARC.most,
      sign = Math.sign(part),
      first = Math.PI / 2;
    const ring = new THREE.RingGeometry(
      this.radius - this.thick,
      this.radius + this.thick,
      48,
      1,
      Math.min(first, first + swing),
      Math.abs(swing),
    );
    const head = new THREE.CircleGeometry(HEAD.radius * 1.15 * this.thick, 3);
    const end = first + swing;
    head
      .scale(1.3, 1, 1)
      .rotateZ(end + (sign * Math.PI) / 2)
      .translate(this.radius * Math.cos(end), this.radius * Math.sin(end), 0);
    for (const geometry of [ring, head]) {
      const mesh = new THREE.Mesh(geometry, this.material);
      mesh.position.copy(start).setZ((0.3 * this.radius) / ARC.radius);
      mesh.renderOrder = 10;
      this.object.add(mesh);
    }
    this.count++;
  }

  end() {}
}
