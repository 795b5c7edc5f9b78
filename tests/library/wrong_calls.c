/* Calls that are wrong in every way but by pointers to memory that is not there. Usage: wrong_calls SCENE BROKEN_SCENE */
#include <linkdyn.h>

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int n_wrong;

/* A call must fail with a code, and a line that has some words. */
static void expect(int line, int code, int wanted, const char *words)
{
    const char *text = linkdyn_last_error();

    printf("%d: %s\n", code, text);
    if (code != wanted || strstr(text, words) == NULL || strchr(text, '\n') != NULL) {
        printf("line %d: expected %d and '%s'\n", line, wanted, words);
        n_wrong++;
    }
}

#define REFUSED(call, words) expect(__LINE__, call, LINKDYN_BAD_INPUT, words)
#define CLOSED(call, words) expect(__LINE__, call, LINKDYN_CLOSED, words)
#define FINE(call) \
    do { \
        if ((call) != LINKDYN_OK) { \
            printf("line %d: %s\n", __LINE__, linkdyn_last_error()); \
            n_wrong++; \
        } \
    } while (0)

int main(int n_argument, char **argument)
{
    linkdyn_scene *scene = NULL, *untouched = NULL;
    linkdyn_run *run = NULL, *no_run = NULL;
    double q[1] = {0.6}, qd[1] = {0.1}, qdd[1] = {0.2}, load[12] = {0}, force[1], reaction[8], variable[4], t = 0;
    double position[9], axes[27];
    int status[1];
    size_t n = 99;
    char name[LINKDYN_NAME_ROOM];
    linkdyn_result wanted = {"driving_force", force, 1};
    linkdyn_inverse_settings settings = {NULL, 0, 0};
    linkdyn_run_settings run_settings = {NULL, NULL, 0, 0, 0, 0, 0, 0, 0};

    if (n_argument != 3) {
        return 2;
    }
    /* opening */
    REFUSED(linkdyn_open_file(NULL, &scene), "path is a null pointer");
    REFUSED(linkdyn_open_file(argument[1], NULL), "null pointer");
    REFUSED(linkdyn_open_file("nowhere.toml", &untouched), "nowhere.toml");
    REFUSED(linkdyn_open_file("", &untouched), "");
    REFUSED(linkdyn_open_file(argument[2], &untouched), "J9");
    REFUSED(linkdyn_open_text(NULL, 3, NULL, NULL, &untouched), "text is a null pointer");
    REFUSED(linkdyn_open_text("space", SIZE_MAX, NULL, NULL, &untouched), "size is too large");
    REFUSED(linkdyn_open_text("", 0, NULL, NULL, &untouched), "scene: the scene is empty");
    REFUSED(linkdyn_open_text("a\0b = 1", 7, "zero", NULL, &untouched), "zero");
    REFUSED(linkdyn_open_text("[[link]]\nname = 3", 17, "three\033[2J", NULL, &untouched), "three\\x1B[2J");
    if (untouched != NULL) {
        n_wrong++;
    }
    FINE(linkdyn_open_file(argument[1], &scene));

    /* handles */
    CLOSED(linkdyn_close(NULL), "null");
    CLOSED(linkdyn_close((linkdyn_scene *)(uintptr_t)12345678901u), "closed");
    CLOSED(linkdyn_close((linkdyn_scene *)(uintptr_t)-1), "closed");
    CLOSED(linkdyn_finish(NULL), "null");
    REFUSED(linkdyn_finish((linkdyn_run *)scene), "not that of a run");
    CLOSED(linkdyn_count(NULL, "link", &n), "null");
    CLOSED(linkdyn_advance(no_run, 1.0), "null");
    REFUSED(linkdyn_advance((linkdyn_run *)scene, 1.0), "not that of a run");

    /* lists */
    REFUSED(linkdyn_count(scene, NULL, &n), "null pointer");
    REFUSED(linkdyn_count(scene, "link", NULL), "null pointer");
    REFUSED(linkdyn_count(scene, "joints", &n), "did you mean");
    REFUSED(linkdyn_name(scene, "joint", 4, name, sizeof name), "below 4");
    REFUSED(linkdyn_name(scene, "joint", SIZE_MAX, name, sizeof name), "below 4");
    REFUSED(linkdyn_name(scene, "joint", 0, name, 2), "expected 3 characters");
    REFUSED(linkdyn_name(scene, "joint", 0, NULL, 2), "null pointer");
    REFUSED(linkdyn_unit(scene, "joint", 0, name, sizeof name), "no units");
    REFUSED(linkdyn_width(scene, "reactions", &n), "did you mean");
    if (n != 99) {
        n_wrong++;
    }

    /* inverse dynamics */
    REFUSED(linkdyn_compute_inverse(scene, NULL, 1, 2, q, qd, qdd, 2, load, 1, &wanted, status), "n_coordinate");
    REFUSED(linkdyn_compute_inverse(scene, NULL, 1, 1, q, qd, qdd, 0, NULL, 1, &wanted, status), "n_load");
    {
        const double never = NAN;
        REFUSED(linkdyn_compute_inverse_at(scene, NULL, 1, &never, 1, q, qd, qdd, 2, load, 1, &wanted, status), "t[0]");
    }
    REFUSED(linkdyn_compute_inverse(scene, NULL, 1, 1, NULL, qd, qdd, 2, load, 1, &wanted, status), "q is a null pointer");
    REFUSED(linkdyn_compute_inverse(scene, NULL, 1, 1, q, qd, qdd, 2, NULL, 1, &wanted, status), "load is a null pointer");
    REFUSED(linkdyn_compute_inverse(scene, NULL, 1, 1, q, qd, qdd, 2, load, 1, NULL, status), "results is a null pointer");
    REFUSED(linkdyn_compute_inverse(scene, NULL, 1, 1, q, qd, qdd, 2, load, 1, &wanted, NULL), "status is a null pointer");
    REFUSED(linkdyn_compute_inverse(scene, NULL, SIZE_MAX, 1, q, qd, qdd, 2, load, 1, &wanted, status), "n is too large");
    REFUSED(linkdyn_compute_inverse(scene, NULL, 2147483647, 1, q, qd, qdd, 2, load, 1, &wanted, status), "samples");
    REFUSED(linkdyn_compute_inverse(scene, NULL, 1, 1, q, qd, qdd, 2, load, 99, &wanted, status), "n_result");
    wanted.size = 2;
    REFUSED(linkdyn_compute_inverse(scene, NULL, 1, 1, q, qd, qdd, 2, load, 1, &wanted, status), "expected 1 x 1");
    wanted.size = 1;
    wanted.values = NULL;
    REFUSED(linkdyn_compute_inverse(scene, NULL, 1, 1, q, qd, qdd, 2, load, 1, &wanted, status), "driving_force is a null");
    wanted.values = force;
    wanted.name = NULL;
    REFUSED(linkdyn_compute_inverse(scene, NULL, 1, 1, q, qd, qdd, 2, load, 1, &wanted, status), "null pointer");
    wanted.name = "driving_farce";
    REFUSED(linkdyn_compute_inverse(scene, NULL, 1, 1, q, qd, qdd, 2, load, 1, &wanted, status), "did you mean");
    wanted.name = "driving_force";
    {
        double other[1];
        const linkdyn_result twice[] = {wanted, {"driving_force", other, 1}};
        REFUSED(linkdyn_compute_inverse(scene, NULL, 1, 1, q, qd, qdd, 2, load, 2, twice, status), "twice");
    }
    q[0] = NAN;
    REFUSED(linkdyn_compute_inverse(scene, NULL, 1, 1, q, qd, qdd, 2, load, 1, &wanted, status), "'J1'");
    q[0] = 0.6;
    load[7] = INFINITY;
    REFUSED(linkdyn_compute_inverse(scene, NULL, 1, 1, q, qd, qdd, 2, load, 1, &wanted, status), "wrench");
    load[7] = 0;
    settings.solver = "lapuck";
    REFUSED(linkdyn_compute_inverse(scene, &settings, 1, 1, q, qd, qdd, 2, load, 1, &wanted, status), "lapuck");
    settings.solver = "reduced";
    wanted.name = "reaction";
    wanted.values = reaction;
    n = 0;
    FINE(linkdyn_width(scene, "reaction", &n));
    wanted.size = n;
    if (n <= sizeof reaction / sizeof *reaction) {
        REFUSED(linkdyn_compute_inverse(scene, &settings, 1, 1, q, qd, qdd, 2, load, 1, &wanted, status), "reduced");
    }
    settings.solver = NULL;
    settings.threads = -1;
    wanted = (linkdyn_result){"driving_force", force, 1};
    REFUSED(linkdyn_compute_inverse(scene, &settings, 1, 1, q, qd, qdd, 2, load, 1, &wanted, status), "threads");
    FINE(linkdyn_compute_inverse(scene, NULL, 0, 1, NULL, NULL, NULL, 2, NULL, 0, NULL, NULL));
    FINE(linkdyn_compute_inverse(scene, NULL, 1, 1, q, qd, qdd, 2, load, 0, NULL, status));

    /* motion and positions */
    t = NAN;
    REFUSED(linkdyn_evaluate_motion(scene, 1, &t, 1, q, qd, qdd, 2, load), "t[0]");
    t = 0;
    REFUSED(linkdyn_evaluate_motion(scene, 1, &t, 3, q, qd, qdd, 2, load), "n_coordinate");
    REFUSED(linkdyn_evaluate_motion(scene, 1, NULL, 1, q, qd, qdd, 2, load), "t is a null pointer");
    q[0] = INFINITY;
    REFUSED(linkdyn_find_poses(scene, 1, 1, q, 3, position, axes, status), "'J1'");
    q[0] = 0.6;
    REFUSED(linkdyn_find_poses(scene, 1, 1, q, 4, position, axes, status), "n_link");
    FINE(linkdyn_find_poses(scene, 1, 1, q, 3, position, axes, status));

    /* runs */
    REFUSED(linkdyn_start(scene, NULL, NAN, &run), "t is not a finite number");
    REFUSED(linkdyn_start(scene, NULL, 0.0, NULL), "null pointer");
    run_settings.step = -1;
    REFUSED(linkdyn_start(scene, &run_settings, 0.0, &run), "step");
    run_settings.step = NAN;
    REFUSED(linkdyn_start(scene, &run_settings, 0.0, &run), "step");
    run_settings.step = 0;
    run_settings.method = "euler";
    REFUSED(linkdyn_start(scene, &run_settings, 0.0, &run), "euler");
    run_settings.method = NULL;
    run_settings.t_end = -1;
    REFUSED(linkdyn_start(scene, &run_settings, 0.0, &run), "t_end");
    if (run != NULL) {
        n_wrong++;
    }
    FINE(linkdyn_start(scene, NULL, 0.0, &run));
    FINE(linkdyn_advance(run, 0.1));
    REFUSED(linkdyn_advance(run, 0.05), "from 0.1");
    REFUSED(linkdyn_advance(run, NAN), "expected an instant");
    REFUSED(linkdyn_get_state(run, &t, 2, q, qd, 0, NULL), "n_coordinate");
    REFUSED(linkdyn_get_state(run, &t, 1, q, qd, 3, variable), "n_variable");
    REFUSED(linkdyn_get_state(run, &t, 1, q, NULL, 0, NULL), "qd is a null pointer");
    FINE(linkdyn_get_state(run, &t, 1, q, qd, 4, variable));
    variable[1] += 1;
    REFUSED(linkdyn_set_state(run, t, 1, q, qd, 4, variable), "no assembly");
    variable[1] = NAN;
    REFUSED(linkdyn_set_state(run, t, 1, q, qd, 4, variable), "joint_variable[1]");
    q[0] = NAN;
    REFUSED(linkdyn_set_state(run, t, 1, q, qd, 0, NULL), "'J1'");
    REFUSED(linkdyn_get_result(run, NULL), "null pointer");
    wanted.name = "status_quo";
    REFUSED(linkdyn_get_result(run, &wanted), "no result");
    wanted.name = "driving_force";
    wanted.size = 7;
    REFUSED(linkdyn_get_result(run, &wanted), "does not fit");
    wanted.size = 1;
    FINE(linkdyn_get_result(run, &wanted));
    FINE(linkdyn_close(scene));
    FINE(linkdyn_advance(run, 0.2));
    FINE(linkdyn_finish(run));
    CLOSED(linkdyn_finish(run), "closed");
    CLOSED(linkdyn_advance(run, 0.3), "closed");
    CLOSED(linkdyn_close(scene), "closed");
    CLOSED(linkdyn_compute_inverse(scene, NULL, 1, 1, q, qd, qdd, 2, load, 0, NULL, status), "closed");

    /* a place is let again, the old number is not */
    for (int i = 0; i < 1000; i++) {
        FINE(linkdyn_open_file(argument[1], &untouched));
        CLOSED(linkdyn_close(scene), "closed");
        FINE(linkdyn_close(untouched));
    }
    puts(n_wrong == 0 ? "all refused" : "some were not refused");
    return n_wrong != 0;
}
