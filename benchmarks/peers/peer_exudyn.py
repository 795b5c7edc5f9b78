"""Exudyn: a kinematic tree closed by spherical joints, index 3, its implicit integrators."""

from __future__ import annotations

import os
import sys

import numpy as np

with open(os.devnull, "w") as nowhere:      # it greets
    sys.stdout, out = nowhere, sys.stdout
    import exudyn
    from exudyn import itemInterface as item
    sys.stdout = out

from work import Mechanism, more_steps, say, series

METHODS = {
    "generalized alpha": exudyn.DynamicSolverType.GeneralizedAlpha,
    "trapezoidal, index 2": exudyn.DynamicSolverType.TrapezoidalIndex2,
}
JOINTS = {f"{kind}{axis}": getattr(exudyn.JointType, f"{word}{axis.upper()}")
          for kind, word in (("P", "Prismatic"), ("R", "Revolute")) for axis in "xyz"}


def assemble(mechanism: Mechanism) -> tuple[exudyn.MainSystem, int]:
    """The system and the number of its node."""
    system = exudyn.SystemContainer().AddSystem()
    links, zero = mechanism.links, [0.0] * len(mechanism.links)
    node = system.AddNode(item.NodeGenericODE2(referenceCoordinates=zero, initialCoordinates=mechanism.start.tolist(),
                                               initialCoordinates_t=zero, numberOfODE2Coordinates=len(links)))
    tree = system.AddObject(item.ObjectKinematicTree(
        nodeNumber=node, jointTypes=[JOINTS[link.joint] for link in links], linkParents=[link.parent for link in links],
        jointTransformations=exudyn.Matrix3DList([np.eye(3)] * len(links)), jointOffsets=exudyn.Vector3DList([np.array(link.at) for link in links]),
        linkInertiasCOM=exudyn.Matrix3DList([np.reshape(link.inertia, (3, 3)) for link in links]),
        linkCOMs=exudyn.Vector3DList([np.array(link.cog) for link in links]), linkMasses=[link.mass for link in links],
        jointForceVector=[link.force for link in links], jointPControlVector=[link.stiffness for link in links],
        jointDControlVector=[link.damping for link in links], jointPositionOffsetVector=[link.rest for link in links],
        jointVelocityOffsetVector=zero, gravity=mechanism.gravity))

    def marker(link: int, point: list[float]) -> int:
        return system.AddMarker(item.MarkerKinematicTreeRigid(objectNumber=tree, linkNumber=link, localPosition=point))

    axes = [1, 1, 0] if mechanism.planar else [1, 1, 1]
    for loop in mechanism.loops:
        ends = [marker(link, point) for link, point in zip(loop.links, loop.points)]
        system.AddObject(item.ObjectJointSpherical(markerNumbers=ends, constrainedAxes=axes))
    ground = system.AddObject(item.ObjectGround())
    for spring in mechanism.springs:
        ends = [system.AddMarker(item.MarkerBodyPosition(bodyNumber=ground, localPosition=spring.ground)), marker(spring.link, spring.point)]
        system.AddObject(item.ObjectConnectorSpringDamper(markerNumbers=ends, stiffness=spring.stiffness, referenceLength=spring.rest))
    system.Assemble()
    return system, node


def forward(mechanism: Mechanism, method: str) -> list[dict]:
    system, node = assemble(mechanism)
    settings = exudyn.SimulationSettings()
    settings.timeIntegration.endTime = mechanism.end
    settings.timeIntegration.verboseMode = 0
    settings.timeIntegration.newton.useModifiedNewton = False
    settings.timeIntegration.newton.relativeTolerance = 1e-10
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.9
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = 1e9
    settings.parallel.numberOfThreads = 1

    def run(steps: int) -> np.ndarray:
        settings.timeIntegration.numberOfSteps = steps
        system.SolveDynamic(settings, solverType=METHODS[method])
        found = [system.GetNodeOutput(node, kind) for kind in (exudyn.OutputVariableType.Coordinates, exudyn.OutputVariableType.Coordinates_t)]
        return np.concatenate([np.atleast_1d(values)[mechanism.coordinates] for values in found])

    return series(run, more_steps(100), method)


version = f"Exudyn {exudyn.__version__}"
if sys.argv[1] == "inverse":
    say(version=version, lacks="no inverse dynamics of a tree that its Python interface gives")
else:
    mechanism = Mechanism.read(sys.argv[2])
    say(version=version, rows=[row for method in METHODS for row in forward(mechanism, method)])
