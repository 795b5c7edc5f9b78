"""MuJoCo: constraints are soft, made as stiff as its options allow; mj_step makes all steps of a run in one call."""

from __future__ import annotations

import sys

import mujoco
import numpy as np

import hexapod
from work import Link, Mechanism, more_steps, say, series

LEAST = 2e-15
"""kg m2: a thin rod's inertia about itself, which may not be zero."""
STIFFEST = 0.9999
"""Of solimp: the share of a constraint's own acceleration that is enforced."""


def add_joint(body: mujoco.MjsBody, link: Link) -> None:
    body.add_joint(
        type=mujoco.mjtJoint.mjJNT_SLIDE if link.slides else mujoco.mjtJoint.mjJNT_HINGE,
        axis=link.axis, stiffness=link.stiffness, springref=link.rest, damping=link.damping,
    )


def compile_model(mechanism: Mechanism) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.gravity = mechanism.gravity
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.tolerance, spec.option.iterations = 0.0, 20
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONTACT
    bodies: list[mujoco.MjsBody] = []
    waiting: list[Link] = []
    for link in mechanism.links:
        waiting.append(link)
        if link.mass == 0.0:
            bodies.append(None)      # its joint goes to the next body, where all of a row lie
            continue
        parent = spec.worldbody if waiting[0].parent < 0 else bodies[waiting[0].parent]
        body = parent.add_body(name=f"body{len(bodies)}", pos=waiting[0].at, mass=link.mass, ipos=link.cog, explicitinertial=True)
        body.inertia = np.maximum(np.diag(np.reshape(link.inertia, (3, 3))), LEAST)      # no link of the work has products of inertia
        for one in waiting:
            add_joint(body, one)
        bodies.append(body)
        waiting = []
    for k, loop in enumerate(mechanism.loops):
        names = []
        for i, (link, point) in enumerate(zip(loop.links, loop.points)):
            bodies[link].add_site(name=f"loop{k}{i}", pos=point)
            names.append(f"loop{k}{i}")
        spec.add_equality(type=mujoco.mjtEq.mjEQ_CONNECT, objtype=mujoco.mjtObj.mjOBJ_SITE, name1=names[0], name2=names[1])
    for k, spring in enumerate(mechanism.springs):
        spec.worldbody.add_site(name=f"ground{k}", pos=spring.ground)
        bodies[spring.link].add_site(name=f"spring{k}", pos=spring.point)
        tendon = spec.add_tendon(stiffness=spring.stiffness, springlength=[spring.rest, spring.rest])
        tendon.wrap_site(f"ground{k}")
        tendon.wrap_site(f"spring{k}")
    return spec.compile()


def forward(mechanism: Mechanism, softness: float) -> list[dict]:
    """Time constant of constraints: `softness` steps; MuJoCo allows no less than two."""
    model = compile_model(mechanism)
    data = mujoco.MjData(model)
    force = [link.force for link in mechanism.links]
    model.eq_solimp[:, :2] = STIFFEST

    def run(steps: int) -> np.ndarray:
        model.opt.timestep = mechanism.end / steps
        model.eq_solref[:] = softness * model.opt.timestep, 1.0
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = mechanism.start, 0.0, force
        mujoco.mj_step(model, data, steps)
        return np.concatenate([data.qpos[mechanism.coordinates], data.qvel[mechanism.coordinates]])

    return series(run, more_steps(100), "RK4")


def inverse(mechanism: Mechanism, samples: str) -> dict:
    model = compile_model(mechanism)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EQUALITY | mujoco.mjtDisableBit.mjDSBL_SPRING
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_DAMPER
    data = mujoco.MjData(model)
    position, velocity, acceleration, force = data.qpos, data.qvel, data.qacc, data.qfrc_inverse

    def tree(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        found = np.empty_like(q)
        for i in range(len(q)):
            position[:], velocity[:], acceleration[:] = q[i], qd[i], qdd[i]
            mujoco.mj_inverse(model, data)
            found[i] = force
        return found

    return hexapod.measure(mechanism, samples, tree)


mechanism = Mechanism.read(sys.argv[2])
version = f"MuJoCo {mujoco.__version__}"
if sys.argv[1] == "inverse":
    say(version=version, **inverse(mechanism, sys.argv[3]))
else:
    say(version=version, rows=[row for softness in (2.0, 10.0) for row in forward(mechanism, softness)])
