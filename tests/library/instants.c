/* Scenes whose forces ask for the time: refused without instants, computed with them. Usage: instants SCENE */
#include <linkdyn.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { n = 11 };

static void check(int code)
{
    if (code != LINKDYN_OK) {
        puts(linkdyn_last_error());
        exit(1);
    }
}

int main(int n_argument, char **argument)
{
    linkdyn_scene *scene;
    double t[n];
    int status[n];
    size_t n_q, n_load, n_force;

    check(n_argument == 2 ? linkdyn_open_file(argument[1], &scene) : LINKDYN_BAD_INPUT);
    check(linkdyn_count(scene, "coordinate", &n_q));
    check(linkdyn_count(scene, "load", &n_load));
    check(linkdyn_width(scene, "driving_force", &n_force));
    double *q = calloc(3 * n * n_q, sizeof *q), *load = calloc(6 * n * n_load + 1, sizeof *load);
    double *qd = q + n * n_q, *qdd = qd + n * n_q, *force = calloc(n * n_force, sizeof *force);
    const linkdyn_result wanted = {"driving_force", force, n * n_force};
    for (int i = 0; i < n; i++) {
        t[i] = 0.1 * i;
    }
    check(linkdyn_evaluate_motion(scene, n, t, n_q, q, qd, qdd, n_load, load));
    if (linkdyn_compute_inverse(scene, NULL, n, n_q, q, qd, qdd, n_load, load, 1, &wanted, status) != LINKDYN_BAD_INPUT ||
        strstr(linkdyn_last_error(), "no instants are given") == NULL) {
        puts("not refused");
        return 1;
    }
    check(linkdyn_compute_inverse_at(scene, NULL, n, t, n_q, q, qd, qdd, n_load, load, 1, &wanted, status));
    for (size_t i = 0; i < n * n_force; i++) {
        printf("%.17g\n", force[i]);
    }
    check(linkdyn_close(scene));
    free(q), free(load), free(force);
    return 0;
}
