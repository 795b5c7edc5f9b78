/* All 78 unknowns of a platform on six UPS legs, by hand: the yardstick for what the record makes of such a scene. */
#ifndef LINKDYN_HAND_HEXAPOD_H
#define LINKDYN_HAND_HEXAPOD_H

enum { LANES = 8, LEGS = 6, GIVEN = 24, UNKNOWNS = 78 };

/* One value of eight samples side by side. */
typedef double wide __attribute__((vector_size(LANES * sizeof(double))));

/* Lengths [m], masses [kg]; elements xx, yy, zz, xy, yz, zx of the inertia tensor about the centre of mass [kg m2]. */
struct body {
    double mass, cog[3], inertia[6];
};

struct hexapod {
    double gravity[3];
    struct body platform;
    double base[LEGS][3], top[LEGS][3];   /* of the universal joints, and of the spherical ones in platform axes */
    double axis[LEGS][3];                 /* unit vectors: first axes of the universal joints */
    struct body lower[LEGS], upper[LEGS]; /* in leg axes: from the universal joint, and from the spherical one */
    int row[6], column[6];                /* order of pivots of the platform's equations, see hexapod_order */
};

/* given: pose x y z [m], roll pitch yaw [rad], their rates, accelerations, and force and moment of the loads about the platform's
   origin, world axes [N, N m].
   unknown, leg by leg, in leg axes (z from the universal to the spherical joint): force on the leg at the spherical joint (3), force on
   the ram at the slide, the third component being the driving force (3), moment on the ram about the spherical joint (3), force on
   the housing at the universal joint (3), moment there along the normal of both axes (1).
   Gaussian elimination without looking at pivots while it runs: for poses near that by which they were ordered. */
void hexapod_forces(const struct hexapod *machine, long blocks, const wide given[][GIVEN], wide unknown[][UNKNOWNS]);

/* Order the pivots by the size they have at a pose. */
void hexapod_order(struct hexapod *machine, const wide given[GIVEN]);

#endif
