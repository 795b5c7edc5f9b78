// Camera, light, ground, and what the pointer does with them. Draws only when something has changed.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { niceBelow } from "./numbers.js";
import { vector } from "./shapes.js";

const ANGLE = 32; // of the eye, degrees
const ROOM = { planar: 1.12, spatial: 1.3 }; // round the mechanism; arrows stand out of it

export class Stage {
  constructor(container, run) {
    this.run = run;
    this.container = container;
    this.renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.shadowMap.enabled = !run.planar;
    this.renderer.domElement.setAttribute("aria-label", run.title);
    container.append(this.renderer.domElement);
    this.scene = new THREE.Scene();
    this.up = vector(run.up);
    const [low, high] = run.box.map(vector);
    this.centre = low.clone().add(high).multiplyScalar(0.5);
    this.camera = run.planar ? new THREE.OrthographicCamera() : new THREE.PerspectiveCamera(ANGLE);
    this.camera.up.copy(run.planar ? vector([0, 1, 0]) : this.up);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.enableRotate = !run.planar;
    this.controls.zoomToCursor = true;
    if (run.planar)
      Object.assign(this.controls, {
        mouseButtons: { LEFT: THREE.MOUSE.PAN, MIDDLE: THREE.MOUSE.DOLLY, RIGHT: THREE.MOUSE.PAN },
        touches: { ONE: THREE.TOUCH.PAN, TWO: THREE.TOUCH.DOLLY_PAN },
      });
    this.controls.addEventListener("change", () => this.request());
    this.drawn = []; // called after each picture
    this.fits = 0; // how often the eye was put back
    this.cell = niceBelow(run.extent / 4);
    new ResizeObserver(() => {
      this.resize();
      this.draw(); // before the browser paints: another size empties the picture
    }).observe(container);
    this.resize();
    this.fit();
  }

  /** An empty scene with its ground and light. */
  furnish(colours) {
    this.scene.clear();
    this.scene.background = new THREE.Color(colours.background);
    if (this.run.planar) this.drawGrid(colours);
    else this.drawGround(colours);
    if (!this.run.planar || this.run.meshes.length) this.light();
  }

  light() {
    const { extent } = this.run;
    const sun = new THREE.DirectionalLight(0xffffff, 2.2);
    const [side, front] = this.horizontal();
    sun.position
      .copy(this.centre)
      .addScaledVector(this.up, 3 * extent)
      .addScaledVector(side, 1.3 * extent)
      .addScaledVector(front, 1.1 * extent);
    sun.target.position.copy(this.centre);
    sun.castShadow = true;
    sun.shadow.mapSize.set(2048, 2048);
    sun.shadow.radius = 4;
    sun.shadow.normalBias = 0.01 * extent;
    Object.assign(sun.shadow.camera, {
      left: -extent,
      right: extent,
      top: extent,
      bottom: -extent,
      near: 0.1 * extent,
      far: 8 * extent,
    });
    const sky = new THREE.HemisphereLight(0xffffff, 0x8d949c, 1.7);
    sky.position.copy(this.up);
    this.scene.add(sun, sun.target, sky);
  }

  /** Two directions across `up`. */
  horizontal() {
    const first = Math.abs(this.up.x) > 0.9 ? vector([0, 1, 0]) : vector([1, 0, 0]);
    return [first, new THREE.Vector3().crossVectors(this.up, first)];
  }

  drawGround(colours) {
    const { extent, ground } = this.run;
    const n = 2 * Math.ceil((1.5 * extent) / this.cell);
    const grid = new THREE.GridHelper(n * this.cell, n, colours.groundLine, colours.ground);
    const floor = new THREE.Mesh(
      new THREE.PlaneGeometry(n * this.cell, n * this.cell).rotateX(-Math.PI / 2),
      new THREE.ShadowMaterial({ opacity: 0.16 }),
    );
    floor.receiveShadow = true;
    const plane = new THREE.Group().add(grid, floor);
    plane.quaternion.setFromUnitVectors(vector([0, 1, 0]), this.up);
    plane.position.copy(this.centre).addScaledVector(this.up, ground - this.centre.dot(this.up));
    const snap = (value) => Math.round(value / this.cell) * this.cell;
    for (const axis of this.horizontal())
      plane.position.addScaledVector(axis, snap(plane.position.dot(axis)) - plane.position.dot(axis));
    this.scene.add(plane);
  }

  drawGrid(colours) {
    const n = 2 * Math.ceil((12 * this.run.extent) / this.cell); // the widest windows are filled
    const grid = new THREE.GridHelper(n * this.cell, n, colours.groundLine, colours.ground).rotateX(Math.PI / 2);
    grid.position.z = -0.2 * this.run.extent;
    const snap = (value) => Math.round(value / this.cell) * this.cell;
    grid.position.x = snap(this.centre.x);
    grid.position.y = snap(this.centre.y);
    this.scene.add(grid);
  }

  /** The eye back to where the whole motion is seen. */
  fit() {
    const { camera, centre } = this;
    const aspect = this.width / this.height;
    this.controls.target.copy(centre);
    if (this.run.planar) {
      const [low, high] = this.run.box;
      this.half = (ROOM.planar / 2) * Math.max(high[1] - low[1], (high[0] - low[0]) / aspect);
      camera.zoom = 1;
      camera.position.copy(centre).setZ(10 * this.run.extent);
    } else {
      const [side, front] = this.horizontal();
      const [azimuth, elevation] = this.run.eye.map(THREE.MathUtils.degToRad);
      const towards = this.up
        .clone()
        .multiplyScalar(Math.sin(elevation))
        .addScaledVector(side, Math.cos(elevation) * Math.cos(azimuth))
        .addScaledVector(front, Math.cos(elevation) * Math.sin(azimuth));
      const right = new THREE.Vector3().crossVectors(this.up, towards).normalize();
      const above = new THREE.Vector3().crossVectors(towards, right);
      const tangent = Math.tan(THREE.MathUtils.degToRad(ANGLE / 2));
      const distances = pointsOf(this.run.arrays.cloud).map((point) => {
        const offset = point.sub(centre);
        return (
          offset.dot(towards) +
          (ROOM.spatial / tangent) * Math.max(Math.abs(offset.dot(above)), Math.abs(offset.dot(right)) / aspect)
        );
      });
      camera.position.copy(centre).addScaledVector(towards, Math.max(...distances));
    }
    this.fits++;
    this.resize();
    this.controls.update();
  }

  resize() {
    this.width = Math.max(1, this.container.clientWidth);
    this.height = Math.max(1, this.container.clientHeight);
    this.renderer.setSize(this.width, this.height);
    const { camera } = this,
      aspect = this.width / this.height,
      far = 100 * this.run.extent;
    if (this.run.planar) {
      const half = this.half ?? 1;
      Object.assign(camera, { left: -half * aspect, right: half * aspect, top: half, bottom: -half, near: 0, far });
    } else Object.assign(camera, { aspect, near: 0.01 * this.run.extent, far });
    camera.updateProjectionMatrix();
    this.request();
  }

  /** Pixels of a metre at the mechanism. */
  get pixelsPerMetre() {
    if (this.run.planar) return (this.height * this.camera.zoom) / (2 * this.half);
    const distance = this.camera.position.distanceTo(this.controls.target);
    return this.height / (2 * distance * Math.tan(THREE.MathUtils.degToRad(ANGLE / 2)));
  }

  /** Where a point is seen [px], or null if it is behind the eye. */
  project(point) {
    const { x, y, z } = point.clone().project(this.camera);
    return z > 1 ? null : [((x + 1) / 2) * this.width, ((1 - y) / 2) * this.height];
  }

  request() {
    this.pending ??= requestAnimationFrame(() => this.draw());
  }

  draw() {
    cancelAnimationFrame(this.pending);
    this.pending = undefined;
    this.renderer.render(this.scene, this.camera);
    for (const call of this.drawn) call();
  }
}

export function pointsOf({ shape, values }) {
  return Array.from({ length: shape[0] }, (_, i) => new THREE.Vector3().fromArray(values, 3 * i));
}
