// The ways of points through the whole run.

import * as THREE from "three";
import { Line2 } from "three/addons/lines/Line2.js";
import { LineGeometry } from "three/addons/lines/LineGeometry.js";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";

export function drawTraces(run, colourOf, pointAt) {
  const group = new THREE.Group();
  const nFrame = run.arrays.time.values.length;
  for (const trace of run.traces) {
    const material = new LineMaterial({ color: colourOf(trace.link), linewidth: 1.6, transparent: true, opacity: 0.65 });
    for (const piece of pieces(run, trace, nFrame, pointAt)) {
      const line = new Line2(new LineGeometry().setPositions(piece), material);
      if (run.planar) line.position.z = -0.1 * run.extent;
      group.add(line);
    }
  }
  return group;
}

/** Flat lists of points; frames that could not be assembled part them. */
function pieces(run, { link, at }, nFrame, pointAt) {
  const found = [[]];
  const point = new THREE.Vector3();
  for (let frame = 0; frame < nFrame; frame++) {
    if (run.arrays.status.values[frame] !== 0) found.push([]);
    else found.at(-1).push(...pointAt(point.fromArray(at), link, frame).toArray());
  }
  return found.filter((piece) => piece.length > 3);
}
