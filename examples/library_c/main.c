/* linkdyn from C: the reactions along a scene's motion, a controller that asks for one pose at a time, and a forward run.
 *
 * Usage: main SCENE */
#include <linkdyn.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* Every call says how it went. */
static void check(int code)
{
    if (code != LINKDYN_OK) {
        fprintf(stderr, "%s\n", linkdyn_last_error());
        exit(1);
    }
}

static size_t count(linkdyn_scene *scene, const char *what)
{
    size_t n;

    check(linkdyn_count(scene, what, &n));
    return n;
}

static double *room(size_t n)
{
    double *values = calloc(n > 0 ? n : 1, sizeof *values);

    if (!values) {
        exit(1);
    }
    return values;
}

/* A batch: the largest force in each joint over 4 s. */
static void find_largest_reactions(linkdyn_scene *scene)
{
    enum { n = 401 };
    const size_t n_q = count(scene, "coordinate"), n_load = count(scene, "load");
    const size_t n_joint = count(scene, "joint"), n_component = count(scene, "component");
    const size_t n_force = n_component == 3 ? 2 : 3;    /* the rest are moments */
    double *t = room(n), *q = room(n * n_q), *qd = room(n * n_q), *qdd = room(n * n_q), *load = room(n * n_load * 6);
    double *reaction = room(n * n_joint * n_component);
    const linkdyn_result wanted = {"reaction", reaction, n * n_joint * n_component};
    const linkdyn_inverse_settings settings = {.threads = 2, .in_order = 1};
    static int status[n];

    for (size_t i = 0; i < n; i++) {
        t[i] = 4.0 * (double)i / (n - 1);
    }
    check(linkdyn_evaluate_motion(scene, n, t, n_q, q, qd, qdd, n_load, load));
    check(linkdyn_compute_inverse(scene, &settings, n, n_q, q, qd, qdd, n_load, load, 1, &wanted, status));
    for (size_t j = 0; j < n_joint; j++) {
        char name[LINKDYN_NAME_ROOM];
        double largest = 0;

        for (size_t i = 0; i < n; i++) {
            const double *force = reaction + (i * n_joint + j) * n_component;
            double square = 0;

            for (size_t k = 0; k < n_force; k++) {
                square += force[k] * force[k];
            }
            if (status[i] == LINKDYN_SAMPLE_OK && square > largest * largest) {
                largest = sqrt(square);
            }
        }
        check(linkdyn_name(scene, "joint", j, name, sizeof name));
        printf("%s %.9g N\n", name, largest);
    }
    free(t), free(q), free(qd), free(qdd), free(load), free(reaction);
}

/* A fixed-step loop: the driving forces for a pose, from one period to the next. Nothing is allocated in it. */
static void control(linkdyn_scene *scene)
{
    const size_t n_q = count(scene, "coordinate"), n_load = count(scene, "load"), n_actuator = count(scene, "actuator");
    double *q = room(n_q), *qd = room(n_q), *qdd = room(n_q), *load = room(n_load * 6), *force = room(n_actuator);
    const linkdyn_result wanted = {"driving_force", force, n_actuator};
    int status;

    for (int period = 0; period < 3; period++) {
        const double t = 0.5 * period;

        check(linkdyn_evaluate_motion(scene, 1, &t, n_q, q, qd, qdd, n_load, load));    /* here: what the controller wants */
        check(linkdyn_compute_inverse(scene, NULL, 1, n_q, q, qd, qdd, n_load, load, 1, &wanted, &status));
        printf("drive at %.1f s: %.9g\n", t, status == LINKDYN_SAMPLE_OK ? force[0] : NAN);
    }
    free(q), free(qd), free(qdd), free(load), free(force);
}

/* A forward run, and back to where it was: the state says where the links are. */
static void simulate(linkdyn_scene *scene)
{
    const size_t n_q = count(scene, "coordinate"), n_variable = count(scene, "variable");
    double *q = room(n_q), *qd = room(n_q), *variable = room(n_variable);
    double t, energy;
    const linkdyn_result wanted = {"kinetic_energy", &energy, 1};
    linkdyn_run *run;

    check(linkdyn_start(scene, NULL, 0.0, &run));
    check(linkdyn_advance(run, 1.0));
    check(linkdyn_get_state(run, &t, n_q, q, qd, n_variable, variable));
    for (int again = 0; again < 2; again++) {
        check(linkdyn_advance(run, 2.0));
        check(linkdyn_get_result(run, &wanted));
        printf("kinetic energy at 2 s: %.8g J\n", energy);
        check(linkdyn_set_state(run, t, n_q, q, qd, n_variable, variable));
    }
    check(linkdyn_finish(run));
    free(q), free(qd), free(variable);
}

int main(int n_argument, char **argument)
{
    linkdyn_scene *scene;

    if (n_argument != 2) {
        fprintf(stderr, "usage: main SCENE\n");
        return 2;
    }
    check(linkdyn_open_file(argument[1], &scene));
    find_largest_reactions(scene);
    control(scene);
    simulate(scene);
    check(linkdyn_close(scene));
    return 0;
}
