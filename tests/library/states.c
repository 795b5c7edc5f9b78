/* A state, and the run from there on again. The piston's stroke is the coordinate: at each position of it the crank is above or
 * below, and the run gets to the other side. Usage: states SCENE */
#include <linkdyn.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { n_variable = 4 };    /* the crank's angle is the first */

typedef struct {
    double t, q, qd, variable[n_variable];
} state;

static void check(int code)
{
    if (code != LINKDYN_OK) {
        printf("%s\n", linkdyn_last_error());
        exit(1);
    }
}

static void expect(int holds, const char *what)
{
    if (!holds) {
        printf("%s\n", what);
        exit(1);
    }
}

static state state_of(linkdyn_run *run)
{
    state s;

    check(linkdyn_get_state(run, &s.t, 1, &s.q, &s.qd, n_variable, s.variable));
    return s;
}

int main(int n_argument, char **argument)
{
    linkdyn_scene *scene;
    linkdyn_run *run;
    state start, here, later, back;

    if (n_argument != 2) {
        return 2;
    }
    check(linkdyn_open_file(argument[1], &scene));
    check(linkdyn_start(scene, NULL, 0.0, &run));
    start = state_of(run);
    check(linkdyn_advance(run, 0.07));
    here = state_of(run);
    expect(sin(here.variable[0]) * sin(start.variable[0]) < 0, "the crank is still on its side");
    check(linkdyn_advance(run, 0.1));
    later = state_of(run);

    check(linkdyn_set_state(run, here.t, 1, &here.q, &here.qd, n_variable, here.variable));
    back = state_of(run);
    expect(fabs(sin(back.variable[0] - here.variable[0])) < 1e-9, "it was set elsewhere");
    check(linkdyn_advance(run, 0.1));
    back = state_of(run);
    expect(fabs(back.q - later.q) < 1e-7 && fabs(sin(back.variable[0] - later.variable[0])) < 1e-6, "it went on otherwise");

    check(linkdyn_set_state(run, here.t, 1, &here.q, &here.qd, 0, NULL));
    back = state_of(run);
    expect(sin(back.variable[0]) * sin(start.variable[0]) > 0, "without joint variables it is not on the start's side");
    check(linkdyn_finish(run));
    check(linkdyn_close(scene));
    puts("as it went on");
    return 0;
}
