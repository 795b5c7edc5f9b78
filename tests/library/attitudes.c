/* Attitudes as quaternions, and the same as rotation matrices, from a file: for each sample position, velocity, acceleration, then the ten numbers of an attitude.
 * Usage: attitudes SCENE SAMPLES FILE */
#include <linkdyn.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void check(int code)
{
    if (code != LINKDYN_OK) {
        puts(linkdyn_last_error());
        exit(1);
    }
}

static void refuse(int code, const char *words)
{
    if (code != LINKDYN_BAD_INPUT || strstr(linkdyn_last_error(), words) == NULL) {
        printf("not refused: %s\n", words);
        exit(1);
    }
}

/* Rows of the matrix of a quaternion of any length, and the six numbers behind it. */
static void turn_to_matrix(const double *attitude, double *rotation)
{
    const double w = attitude[0], x = attitude[1], y = attitude[2], z = attitude[3], s = w * w + x * x + y * y + z * z;
    const double r[9] = {w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y),
                         2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x),
                         2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z};

    for (int k = 0; k < 9; k++) rotation[k] = r[k] / s;
    for (int k = 0; k < 6; k++) rotation[9 + k] = attitude[4 + k];
}

int main(int n_argument, char **argument)
{
    enum { n_q = 6 };
    linkdyn_scene *scene;
    size_t n_attitude, n_force, n = n_argument == 4 ? (size_t)atoi(argument[2]) : 0;
    FILE *file = fopen(argument[n_argument - 1], "r");
    char name[LINKDYN_NAME_ROOM];

    if (file == NULL) return 1;
    check(linkdyn_open_file(argument[1], &scene));
    check(linkdyn_count(scene, "attitude", &n_attitude));
    check(linkdyn_name(scene, "attitude", 0, name, sizeof name));
    check(linkdyn_width(scene, "driving_force", &n_force));
    printf("%s\n", name);
    double *q = calloc(3 * n * n_q, sizeof *q), *qd = q + n * n_q, *qdd = qd + n * n_q, *attitude = calloc(10 * n, sizeof *attitude);
    double *force = calloc(n * n_force, sizeof *force);
    int *status = calloc(n, sizeof *status);
    const linkdyn_result wanted = {"driving_force", force, n * n_force};
    const linkdyn_inverse_settings in_order = {"elimination", 1, 1};
    for (size_t i = 0; i < n; i++) {
        double *part[] = {q + i * n_q, qd + i * n_q, qdd + i * n_q};
        for (int k = 0; k < 9; k++) {
            if (fscanf(file, "%lf", part[k / 3] + k % 3) != 1) return 1;
        }
        for (int k = 0; k < 10; k++) {
            if (fscanf(file, "%lf", attitude + 10 * i + k) != 1) return 1;
        }
    }
    check(linkdyn_compute_inverse_attitudes(scene, NULL, n, NULL, n_q, q, qd, qdd, n_attitude, attitude, 0, NULL, 1, &wanted, status));
    for (size_t i = 0; i < n; i++) {
        if (status[i] != LINKDYN_SAMPLE_OK || q[i * n_q + 3] != 0) puts("failed, or written into");
    }
    for (size_t i = 0; i < n * n_force; i++) {
        printf("%.17g\n", force[i]);
    }
    refuse(linkdyn_compute_inverse_attitudes(scene, NULL, n, NULL, n_q, q, qd, qdd, 2, attitude, 0, NULL, 1, &wanted, status), "attitude");
    refuse(linkdyn_compute_inverse_attitudes(scene, NULL, n, NULL, n_q, q, qd, qdd, 1, NULL, 0, NULL, 1, &wanted, status), "attitude");
    refuse(linkdyn_compute_inverse_attitudes(scene, &in_order, n, NULL, n_q, q, qd, qdd, 1, attitude, 0, NULL, 1, &wanted, status), "no instants");
    double *rotation = calloc(15 * n, sizeof *rotation), *again = calloc(n * n_force, sizeof *again);
    const linkdyn_result by_matrix = {"driving_force", again, n * n_force};
    for (size_t i = 0; i < n; i++) turn_to_matrix(attitude + 10 * i, rotation + 15 * i);
    check(linkdyn_compute_inverse_rotations(scene, NULL, n, NULL, n_q, q, qd, qdd, n_attitude, rotation, 0, NULL, 1, &by_matrix, status));
    for (size_t i = 0; i < n * n_force; i++) {
        if (!(fabs(again[i] - force[i]) <= 1e-11 * fabs(force[i]))) puts("matrices differ from quaternions");
    }
    refuse(linkdyn_compute_inverse_rotations(scene, NULL, n, NULL, n_q, q, qd, qdd, 2, rotation, 0, NULL, 1, &by_matrix, status), "attitude");
    refuse(linkdyn_compute_inverse_rotations(scene, NULL, n, NULL, n_q, q, qd, qdd, 1, NULL, 0, NULL, 1, &by_matrix, status), "rotation");
    if (linkdyn_compute_inverse_rotations(NULL, NULL, n, NULL, n_q, q, qd, qdd, 1, rotation, 0, NULL, 1, &by_matrix, status) == LINKDYN_OK) puts("a null handle is not refused");
    const double whole[3] = {-1, 1.001, NAN};
    const char *words[3] = {"sample 5 (the first is 0): the rotation of 'platform' mirrors", "sample 5 (the first is 0): the rotation of 'platform' is not a rotation",
                            "sample 5 (the first is 0): the rotation of 'platform' is not of finite numbers"};
    for (int c = 0; c < 3; c++) {
        turn_to_matrix(attitude + 10 * 5, rotation + 15 * 5);
        for (int k = 0; k < 9; k++) rotation[15 * 5 + k] *= whole[c];
        refuse(linkdyn_compute_inverse_rotations(scene, NULL, n, NULL, n_q, q, qd, qdd, 1, rotation, 0, NULL, 1, &by_matrix, status), words[c]);
    }
    turn_to_matrix(attitude + 10 * 5, rotation + 15 * 5);
    rotation[15 * 5 + 10] = NAN;
    refuse(linkdyn_compute_inverse_rotations(scene, NULL, n, NULL, n_q, q, qd, qdd, 1, rotation, 0, NULL, 1, &by_matrix, status), "is not a finite number");
    for (int k = 0; k < 15; k++) rotation[15 * 5 + k] = 0;      /* by its angles */
    check(linkdyn_compute_inverse_rotations(scene, NULL, n, NULL, n_q, q, qd, qdd, 1, rotation, 0, NULL, 1, &by_matrix, status));
    attitude[12] = NAN;
    refuse(linkdyn_compute_inverse_attitudes(scene, NULL, n, NULL, n_q, q, qd, qdd, 1, attitude, 0, NULL, 1, &wanted, status), "attitude[12] is not");
    fclose(file);
    check(linkdyn_close(scene));
    free(q), free(attitude), free(rotation), free(again), free(force), free(status);
    return 0;
}
