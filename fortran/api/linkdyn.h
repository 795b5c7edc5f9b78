/* linkdyn: inverse and forward dynamics of planar and spatial link mechanisms.
 *
 * What holds for all functions:
 *
 * Outcome    A function returns LINKDYN_OK (0) or one of the codes below. Then linkdyn_last_error() has one line of text that
 *            says what was wrong, where, and what was expected; what was to be given back is left alone. No argument but a
 *            pointer to memory that is not there makes a function crash: null handles, closed ones, handles of the wrong kind,
 *            arrays of the wrong size, NaN are errors.
 * Samples    A batch of n samples does not fail as a whole if one of them does: each has a status of its own
 *            (LINKDYN_SAMPLE_OK, ...). The results of one that is not LINKDYN_SAMPLE_OK are NaN. Look at it.
 * Arrays     are the caller's, in C order with the sample slowest: q[sample*n_coordinate + coordinate]. The library keeps no
 *            pointer to them. Nothing is copied on the way.
 * Units      SI and radians: m, rad, s, kg, N, N m, W, J.
 * Names      are UTF-8. Links, joints, ... are counted from 0, in the order of linkdyn_name().
 * Handles    (linkdyn_scene *, linkdyn_run *) belong to the library; they are no addresses. linkdyn_close() and
 *            linkdyn_finish() give them back. A run does not need its scene any more.
 * Threads    Any function may be called from any thread at any time. A scene may be used by many threads at once, a run by
 *            one: a second one is refused. What is closed while others use it lasts until they are done. Threads need the
 *            usual stack of some MB.
 * Memory     A call of linkdyn_compute_inverse() with n = 1 that asks for the same kinds of results as a call before allocates nothing,
 *            with the solvers "elimination" and "reduced" and where no group of links is closed by iteration
 *            (see `linkdyn explain`), unless asked for driving_speed, driving_power, transmission_angle or assembly.
 */
#ifndef LINKDYN_H
#define LINKDYN_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- outcome of a call */
enum {
    LINKDYN_OK = 0,
    LINKDYN_BAD_INPUT = 2,     /* the scene or an argument is wrong */
    LINKDYN_IO_ERROR = 4,      /* a file could not be read */
    LINKDYN_UNAVAILABLE = 5,   /* built without the library that this needs */
    LINKDYN_INTERNAL = 6,      /* a defect of linkdyn */
    LINKDYN_CLOSED = 7,        /* the handle is null, or was closed */
    LINKDYN_STOPPED = 9,       /* a run has ended before the instant, for the reason told */
    LINKDYN_NO_RESULT = 10     /* nothing can be told of this instant of a run; it can go on */
};

/* ---- outcome of a sample */
enum {
    LINKDYN_SAMPLE_OK = 0,
    LINKDYN_SAMPLE_UNREACHABLE = 1,    /* a loop cannot close at this position, or not on the assembly followed */
    LINKDYN_SAMPLE_SINGULAR = 2,       /* the equations have no unique solution here */
    LINKDYN_SAMPLE_NOT_CONVERGED = 3,  /* an iteration ran out of steps */
    LINKDYN_SAMPLE_UNDEFINED = 4,      /* a force has no direction here, or a value is beyond all numbers */
    LINKDYN_SAMPLE_BRANCH_LOST = 5,    /* two assemblies meet on the way: which of them it is cannot be told */
    LINKDYN_SAMPLE_LOCKED = 6          /* friction grows with the forces that it takes to overcome it, without end */
};

typedef struct linkdyn_scene linkdyn_scene;
typedef struct linkdyn_run linkdyn_run;

/* Room for any name or unit, with its end. */
#define LINKDYN_NAME_ROOM 128

/* One result, into an array of the caller's. */
typedef struct linkdyn_result {
    const char *name;      /* one that linkdyn_name() lists under "result", of runs under "run_result" */
    double *values;        /* (n, linkdyn_width()) */
    size_t size;           /* how many numbers these are: n times linkdyn_width(), neither less nor more */
} linkdyn_result;

/* How inverse dynamics is computed. What is zero or NULL is as described. */
typedef struct linkdyn_inverse_settings {
    const char *solver;    /* "elimination" if NULL; or "gauss-jordan", "lapack", "reduced", ... as `linkdyn --help` lists them */
    int threads;           /* at most so many share a batch; 0: one */
    int in_order;          /* 1: the samples follow each other along a motion, and the assembly is followed by continuity;
                              0: each is on its own, on the assembly of the scene's start */
} linkdyn_inverse_settings;

/* How a forward run is computed. What is zero or NULL is as described. */
typedef struct linkdyn_run_settings {
    const char *method;    /* "gbs" if NULL, extrapolation; or "rk4", "seulex", "rkf45", "rk8pd", "msbdf" (the last three need GSL) */
    const char *solver;    /* of the forces, as above */
    double t_end;          /* when the run is to end [s], which steps are judged by; 0: not known */
    double step;           /* of rk4; first one tried by the others [s]; 0: 0.001 */
    double rtol, atol;     /* error of a step allowed, relative and absolute (less for ways below 0.01); 0: 1e-9 */
    int threads;           /* 0: one */
    int keep_coordinates;  /* 1: a coordinate near its dead point is not exchanged for another joint variable */
    int errors;            /* 1: estimate errors too, which takes several times as long */
} linkdyn_run_settings;

/* ---- the library */

/* "0.1.0"; static. The library's file name has the number of its interface: programs go on to work with the same number. */
const char *linkdyn_version(void);

/* Why the last call that failed in this thread did; "" if none has. Valid until the thread's next call. */
const char *linkdyn_last_error(void);

/* ---- scenes */

/* Open a scene file; the tables it names lie beside it. */
int linkdyn_open_file(const char *path, linkdyn_scene **scene);

/* Open a scene given as text. size: its bytes, without an end. name: what to call it in messages; NULL: "scene".
 * folder: where the tables lie that it names; NULL: the current one. */
int linkdyn_open_text(const char *text, size_t size, const char *name, const char *folder, linkdyn_scene **scene);

int linkdyn_close(linkdyn_scene *scene);

/* How many there are of: "link", "joint", "coordinate", "attitude" (links and ball joints whose attitude is given by coordinates
 * roll, pitch, yaw), "actuator", "load", "variable" (joint variables), "component" (of
 * a reaction: Fx Fy Mz, in space Fx Fy Fz Mx My Mz), "dyad" (closed forms that have a transmission angle), "motor" (actuators with a
 * drive), "cam" (joints), "controller", "strand" (runs of belts), "clutch", "cylinder", "chamber" (of cylinders),
 * "result" (of inverse dynamics), "run_result" (of forward dynamics). */
int linkdyn_count(linkdyn_scene *scene, const char *what, size_t *count);

/* The name of number i of them, into room for `room` characters; LINKDYN_NAME_ROOM is enough. */
int linkdyn_name(linkdyn_scene *scene, const char *what, size_t i, char *name, size_t room);

/* The unit of a coordinate, actuator, variable or component, likewise. */
int linkdyn_unit(linkdyn_scene *scene, const char *what, size_t i, char *unit, size_t room);

/* How many numbers a result has in each sample. A reaction has them by joint, then by component: the force and moment of the
 * first link of the joint on the second, at the joint's point, in world axes. */
int linkdyn_width(linkdyn_scene *scene, const char *result, size_t *width);

/* ---- inverse dynamics and positions */

/* The scene's own motion at instants t (n) [s]: coordinates (n, n_coordinate) and their derivatives, loads
 * (n, n_load, 6): force and moment, in the axes that the scene gives them in. load: NULL if n_load is 0. */
int linkdyn_evaluate_motion(linkdyn_scene *scene, size_t n, const double *t, size_t n_coordinate, double *q, double *qd, double *qdd,
                   size_t n_load, double *load);

/* Driving forces, reactions, ... of a motion. Input as linkdyn_evaluate_motion() gives it.
 * settings: NULL for those described.  results: n_result of them, each name once.  status: (n). */
int linkdyn_compute_inverse(linkdyn_scene *scene, const linkdyn_inverse_settings *settings, size_t n, size_t n_coordinate,
                    const double *q, const double *qd, const double *qdd, size_t n_load, const double *load,
                    size_t n_result, const linkdyn_result *results, int *status);

/* The same at instants t (n) [s], for scenes that ask for them: frames that move, payloads and forces over the state that change with
 * time. linkdyn_compute_inverse() refuses these. t: NULL is that function. */
int linkdyn_compute_inverse_at(linkdyn_scene *scene, const linkdyn_inverse_settings *settings, size_t n, const double *t,
                    size_t n_coordinate, const double *q, const double *qd, const double *qdd, size_t n_load, const double *load,
                    size_t n_result, const linkdyn_result *results, int *status);

/* The same with attitudes as quaternions, which have no pole: attitude (n, n_attitude, 10) has of each of them w x y z, of any length but
 * zero, angular velocity and angular acceleration, x y z of each [rad/s, rad/s2]; of links in world axes, of ball joints as in the axes of
 * their first marker. These take the place of roll, pitch and yaw in q, qd and qdd, which are not looked at; but where w x y z are all zero
 * the angles count. Samples in order want t, else it may be NULL. */
int linkdyn_compute_inverse_attitudes(linkdyn_scene *scene, const linkdyn_inverse_settings *settings, size_t n, const double *t,
                    size_t n_coordinate, const double *q, const double *qd, const double *qdd, size_t n_attitude, const double *attitude,
                    size_t n_load, const double *load, size_t n_result, const linkdyn_result *results, int *status);

/* The same with attitudes as rotation matrices: rotation (n, n_attitude, 15) has of each of them the nine numbers of the matrix, row by row,
 * that takes link axes to world axes (of ball joints the second marker's to the first's), then as above angular velocity and acceleration.
 * A matrix that is no rotation to six digits is refused; where all nine are zero the angles count. */
int linkdyn_compute_inverse_rotations(linkdyn_scene *scene, const linkdyn_inverse_settings *settings, size_t n, const double *t,
                    size_t n_coordinate, const double *q, const double *qd, const double *qdd, size_t n_attitude, const double *rotation,
                    size_t n_load, const double *load, size_t n_result, const linkdyn_result *results, int *status);

/* Where the moving links are: origins (n, n_link, 3) [m] and axes (n, n_link, 3, 3): x, y and z axis of the link, one after the
 * other, in world axes. Each sample is on the assembly of the scene's start.  status: (n). */
int linkdyn_find_poses(linkdyn_scene *scene, size_t n, size_t n_coordinate, const double *q, size_t n_link, double *position,
                  double *axes, int *status);

/* ---- forward dynamics */

/* Start a run where the scene does, at the instant t [s]. settings: NULL for those described. */
int linkdyn_start(linkdyn_scene *scene, const linkdyn_run_settings *settings, double t, linkdyn_run **run);

/* Integrate to the instant t [s], not before that of the run. */
int linkdyn_advance(linkdyn_run *run, double t);

/* Where the run is: its instant [s], coordinates and rates (n_coordinate), joint variables (n_variable), which tell the
 * assembly too. joint_variable: NULL if n_variable is 0. */
int linkdyn_get_state(linkdyn_run *run, double *t, size_t n_coordinate, double *q, double *qd, size_t n_variable,
                      double *joint_variable);

/* Put the run somewhere, at any instant: with the joint variables that linkdyn_get_state() gave, on that assembly; without them
 * (n_variable 0, NULL) on the assembly of the scene's start, led straight from there. A driven coordinate must be where its
 * motion is. Work counts from there, and turns of joint angles do. If that cannot be done the run stays as it is. */
int linkdyn_set_state(linkdyn_run *run, double t, size_t n_coordinate, const double *q, const double *qd, size_t n_variable,
                      const double *joint_variable);

/* A result at the run's instant: size is its width. */
int linkdyn_get_result(linkdyn_run *run, const linkdyn_result *result);

int linkdyn_finish(linkdyn_run *run);

#ifdef __cplusplus
}
#endif

#endif
