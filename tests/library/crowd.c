/* Scenes of many kinds, many threads: what one thread alone has computed all must compute again, whatever others do meanwhile: scenes
 * shared, and opened and closed beside them, runs of a thread's own and one that all want. Usage: crowd SCENE... */
#include <linkdyn.h>

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { n_thread = 6, n = 40, most_scenes = 64, most_coordinates = 64 };

typedef struct {
    double *force, *reaction, *place, *axes, q_end[most_coordinates], qd_end[most_coordinates];
    int status[n], where[n], run_code;
    size_t n_q, n_load, n_force, n_reaction, n_link;
} answer;

static int n_scene;
static char **files;
static linkdyn_scene *shared[most_scenes];
static answer first[most_scenes];
static linkdyn_run *wanted_by_all;
static atomic_int n_wrong;

static void complain(int i, const char *what)
{
    fprintf(stderr, "%s: %s: %s\n", files[i], what, linkdyn_last_error());
    n_wrong++;
}

static int compute(int i, linkdyn_scene *scene, answer *a, int team)
{
    const linkdyn_inverse_settings settings = {.threads = team, .in_order = 1};
    double t[n];
    size_t n_variable = 0;

    if (linkdyn_count(scene, "coordinate", &a->n_q) || linkdyn_count(scene, "load", &a->n_load) ||
        linkdyn_width(scene, "driving_force", &a->n_force) || linkdyn_width(scene, "reaction", &a->n_reaction) ||
        linkdyn_count(scene, "link", &a->n_link) || linkdyn_count(scene, "variable", &n_variable)) {
        complain(i, "counts");
        return 1;
    }
    double *q = calloc(3 * n * a->n_q + 1, sizeof *q), *load = calloc(6 * n * a->n_load + 1, sizeof *load);
    a->force = calloc(n * a->n_force + 1, sizeof(double));
    a->reaction = calloc(n * a->n_reaction + 1, sizeof(double));
    a->place = calloc(3 * n * a->n_link, sizeof(double));
    a->axes = calloc(9 * n * a->n_link, sizeof(double));
    for (int k = 0; k < n; k++) {
        t[k] = 0.004 * k;
    }
    const linkdyn_result results[2] = {{"driving_force", a->force, n * a->n_force}, {"reaction", a->reaction, n * a->n_reaction}};
    int code = linkdyn_evaluate_motion(scene, n, t, a->n_q, q, q + n * a->n_q, q + 2 * n * a->n_q, a->n_load,
                                       a->n_load ? load : NULL);
    if (!code) {
        code = linkdyn_compute_inverse_at(scene, &settings, n, t, a->n_q, q, q + n * a->n_q, q + 2 * n * a->n_q, a->n_load,
                                       a->n_load ? load : NULL, 2, results, a->status);
    }
    if (!code) {
        code = linkdyn_find_poses(scene, n, a->n_q, q, a->n_link, a->place, a->axes, a->where);
    }
    linkdyn_run *run;
    double now, *variable = calloc(n_variable + 1, sizeof *variable);
    a->run_code = linkdyn_start(scene, &(linkdyn_run_settings){.t_end = 0.02}, 0.0, &run);
    if (!a->run_code) {
        a->run_code = linkdyn_advance(run, 0.01);
        if (!a->run_code && !linkdyn_get_state(run, &now, a->n_q, a->q_end, a->qd_end, n_variable, n_variable ? variable : NULL)) {
            linkdyn_set_state(run, now, a->n_q, a->q_end, a->qd_end, n_variable, n_variable ? variable : NULL);
        }
        linkdyn_finish(run);
    }
    free(q), free(load), free(variable);
    return code;
}

static void drop(answer *a)
{
    free(a->force), free(a->reaction), free(a->place), free(a->axes);
}

static int same(const answer *a, const answer *b)
{
    return memcmp(a->status, b->status, sizeof a->status) == 0 && memcmp(a->where, b->where, sizeof a->where) == 0 &&
           memcmp(a->force, b->force, n * a->n_force * sizeof(double)) == 0 &&
           memcmp(a->reaction, b->reaction, n * a->n_reaction * sizeof(double)) == 0 &&
           memcmp(a->place, b->place, 3 * n * a->n_link * sizeof(double)) == 0 && a->run_code == b->run_code &&
           memcmp(a->q_end, b->q_end, a->n_q * sizeof(double)) == 0;
}

static void *work(void *number)
{
    const int me = *(int *)number;

    for (int turn = 0; turn < n_scene; turn++) {
        const int i = (turn * (1 + me % 3) + me * 7) % n_scene;
        answer a = {0};
        linkdyn_scene *own;
        double t = 0, q[most_coordinates], qd[most_coordinates];

        if (compute(i, shared[i], &a, 1 + turn % 2) != 0 || !same(&a, &first[i])) {
            complain(i, "the shared scene differs");
        }
        drop(&a);
        if ((turn + me) % 3 == 0) {
            memset(&a, 0, sizeof a);
            if (linkdyn_open_file(files[i], &own) != LINKDYN_OK) {
                complain(i, "does not open");
            } else {
                if (compute(i, own, &a, 1) != 0 || !same(&a, &first[i])) {
                    complain(i, "a scene of its own differs");
                }
                linkdyn_close(own);
                drop(&a);
            }
        }
        /* done, or refused as in use by another thread */
        if (linkdyn_get_state(wanted_by_all, &t, first[0].n_q, q, qd, 0, NULL) == LINKDYN_OK) {
            linkdyn_advance(wanted_by_all, t + 1e-5);
        }
    }
    return NULL;
}

int main(int n_argument, char **argument)
{
    pthread_t thread[n_thread];
    int number[n_thread];

    files = argument + 1;
    n_scene = n_argument - 1;
    for (int i = 0; i < n_scene; i++) {
        linkdyn_scene *apart;
        if (linkdyn_open_file(files[i], &apart) != LINKDYN_OK || linkdyn_open_file(files[i], &shared[i]) != LINKDYN_OK ||
            compute(i, apart, &first[i], 1) != 0) {
            complain(i, "alone");
            return 1;
        }
        linkdyn_close(apart);
    }
    if (linkdyn_start(shared[0], NULL, 0.0, &wanted_by_all) != LINKDYN_OK) {
        complain(0, "a run");
    }
    for (int i = 0; i < n_thread; i++) {
        number[i] = i;
        pthread_create(&thread[i], NULL, work, &number[i]);
    }
    for (int i = 0; i < n_thread; i++) {
        pthread_join(thread[i], NULL);
    }
    linkdyn_finish(wanted_by_all);
    for (int i = 0; i < n_scene; i++) {
        linkdyn_close(shared[i]);
        drop(&first[i]);
    }
    puts(n_wrong == 0 ? "all alike" : "they differ");
    return n_wrong != 0;
}
