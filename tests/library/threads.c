/* Many threads at once: one scene for all of them, scenes of their own, scenes that are refused. Usage: threads SCENE BROKEN */
#include <linkdyn.h>

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { n_thread = 8, n_turn = 40, n = 37 };

static linkdyn_scene *shared;
static char **files;
static double first[n];
static char refusal[600];
static atomic_int n_wrong;

static void complain(const char *what)
{
    fprintf(stderr, "%s: %s\n", what, linkdyn_last_error());
    n_wrong++;
}

/* Driving forces along the motion; 0: as it should be. */
static int compute(linkdyn_scene *scene, const char *solver, double *force)
{
    double t[n], q[n], qd[n], qdd[n], load[n * 12];
    int status[n];
    const linkdyn_inverse_settings settings = {.solver = solver};
    const linkdyn_result wanted = {"driving_force", force, n};

    for (int i = 0; i < n; i++) {
        t[i] = 0.1 * i;
    }
    return linkdyn_evaluate_motion(scene, n, t, 1, q, qd, qdd, 2, load) ||
           linkdyn_compute_inverse(scene, &settings, n, 1, q, qd, qdd, 2, load, 1, &wanted, status);
}

static void *work(void *number)
{
    const int i_thread = *(int *)number;

    for (int turn = 0; turn < n_turn; turn++) {
        linkdyn_scene *own, *refused = NULL;
        linkdyn_run *run;
        double force[n], q, qd, t;
        char name[LINKDYN_NAME_ROOM];

        if (compute(shared, NULL, force) != LINKDYN_OK || memcmp(force, first, sizeof force) != 0) {
            complain("the shared scene");
        }
        if (linkdyn_open_file(files[2], &refused) != LINKDYN_BAD_INPUT || strcmp(linkdyn_last_error(), refusal) != 0) {
            complain("the broken scene");
        }
        if (linkdyn_name(shared, "joint", 1, name, sizeof name) != LINKDYN_OK || strcmp(name, "J2") != 0) {
            complain("a name");
        }
        if ((turn + i_thread) % 4 != 0) {
            continue;
        }
        if (linkdyn_open_file(files[1], &own) != LINKDYN_OK) {
            complain("a scene of the thread's own");
            continue;
        }
        if (compute(own, NULL, force) != LINKDYN_OK || memcmp(force, first, sizeof force) != 0 ||
            linkdyn_start(own, NULL, 0.0, &run) != LINKDYN_OK || linkdyn_close(own) != LINKDYN_OK ||
            linkdyn_advance(run, 0.2) != LINKDYN_OK || linkdyn_get_state(run, &t, 1, &q, &qd, 0, NULL) != LINKDYN_OK ||
            linkdyn_finish(run) != LINKDYN_OK) {
            complain("a scene of the thread's own");
        }
    }
    return NULL;
}

int main(int n_argument, char **argument)
{
    pthread_t thread[n_thread];
    int number[n_thread];
    linkdyn_scene *none = NULL;

    files = argument;
    if (n_argument != 3 || linkdyn_open_file(files[1], &shared) != LINKDYN_OK || compute(shared, NULL, first) != LINKDYN_OK) {
        puts(linkdyn_last_error());
        return 1;
    }
    linkdyn_open_file(files[2], &none);
    strcpy(refusal, linkdyn_last_error());
    for (int i = 0; i < n_thread; i++) {
        number[i] = i;
        pthread_create(&thread[i], NULL, work, &number[i]);
    }
    for (int i = 0; i < n_thread; i++) {
        pthread_join(thread[i], NULL);
    }
    linkdyn_close(shared);
    puts(n_wrong == 0 ? "all alike" : "they differ");
    return n_wrong != 0;
}
