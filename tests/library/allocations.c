/* How many times 100 calls for one pose ask for memory, after a first one. Usage: allocations SCENE */
#include <linkdyn.h>

#include <stdio.h>
#include <stdlib.h>

extern void *__libc_malloc(size_t);
extern void *__libc_calloc(size_t, size_t);
extern void *__libc_realloc(void *, size_t);

static long n_asked;

void *malloc(size_t size)
{
    n_asked++;
    return __libc_malloc(size);
}

void *calloc(size_t n, size_t size)
{
    n_asked++;
    return __libc_calloc(n, size);
}

void *realloc(void *block, size_t size)
{
    n_asked++;
    return __libc_realloc(block, size);
}

int main(int n_argument, char **argument)
{
    linkdyn_scene *scene;
    size_t n_q, n_load, n_force, n_reaction, n_variable;
    long before;

    if (n_argument != 2 || linkdyn_open_file(argument[1], &scene) != LINKDYN_OK) {
        puts(linkdyn_last_error());
        return 1;
    }
    linkdyn_count(scene, "coordinate", &n_q);
    linkdyn_count(scene, "load", &n_load);
    linkdyn_width(scene, "driving_force", &n_force);
    linkdyn_width(scene, "reaction", &n_reaction);
    linkdyn_width(scene, "joint_variable", &n_variable);
    double q[n_q], qd[n_q], qdd[n_q], load[6 * n_load + 1], force[n_force], reaction[n_reaction], variable[n_variable];
    const linkdyn_result wanted[] = {
        {"driving_force", force, n_force}, {"reaction", reaction, n_reaction}, {"joint_variable", variable, n_variable}};

    for (int i = 0; i <= 100; i++) {
        const double t = 0.01 * i;
        int status;

        if (i == 1) {
            before = n_asked;
        }
        if (linkdyn_evaluate_motion(scene, 1, &t, n_q, q, qd, qdd, n_load, load) != LINKDYN_OK ||
            linkdyn_compute_inverse(scene, NULL, 1, n_q, q, qd, qdd, n_load, load, 3, wanted, &status) != LINKDYN_OK ||
            status != LINKDYN_SAMPLE_OK) {
            puts(linkdyn_last_error());
            return 1;
        }
    }
    before = n_asked - before;
    printf("%ld\n", before);
    return 0;
}
