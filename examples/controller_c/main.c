/* A hexapod's feed-forward at 1 kHz: in each period the driving forces for the motion that is wanted, by code that linkdyn has
 * generated. The motion comes from a file, a row a period: t, q, qd, qdd, and the forces that linkdyn itself finds. */
#define _POSIX_C_SOURCE 200112L
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "hexapod.h"

#define PERIOD 1000000L /* ns */
#define MOST 100000     /* periods */

struct row {
    double t;
    struct hexapod_input in;
    double force[HEXAPOD_N_ACTUATOR]; /* of linkdyn [N] */
};

static int read_numbers(FILE *file, int n, double *x)
{
    int i;
    for (i = 0; i < n; i++)
        if (fscanf(file, "%lf", &x[i]) != 1)
            return 0;
    return 1;
}

static int read_row(FILE *file, struct row *row)
{
    row->in = hexapod_start; /* has the loads, if the scene had some */
    return read_numbers(file, 1, &row->t) && read_numbers(file, HEXAPOD_N_COORDINATE, row->in.q)
           && read_numbers(file, HEXAPOD_N_COORDINATE, row->in.qd) && read_numbers(file, HEXAPOD_N_COORDINATE, row->in.qdd)
           && read_numbers(file, HEXAPOD_N_ACTUATOR, row->force);
}

static double seconds_between(const struct timespec *a, const struct timespec *b)
{
    return (double)(b->tv_sec - a->tv_sec) + 1e-9*(double)(b->tv_nsec - a->tv_nsec);
}

static void wait_for(struct timespec *next)
{
    next->tv_nsec += PERIOD;
    if (next->tv_nsec >= 1000000000L) {
        next->tv_nsec -= 1000000000L;
        next->tv_sec++;
    }
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, next, NULL);
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int main(int argc, char **argv)
{
    static struct row row[MOST];
    static double took[MOST];
    struct hexapod_output out = {{0.0}};
    struct timespec next, before, after;
    double largest = 0.0, apart = 0.0;
    int n = 0, i, k;
    FILE *file = argc == 2 ? fopen(argv[1], "r") : NULL;

    if (!file) {
        fprintf(stderr, "usage: %s MOTION (a file as run.py writes it)\n", argv[0]);
        return 2;
    }
    while (n < MOST && read_row(file, &row[n]))
        n++;
    fclose(file);
    if (n == 0) {
        fprintf(stderr, "%s: no motion\n", argv[1]);
        return 2;
    }

    clock_gettime(CLOCK_MONOTONIC, &next);
    for (i = 0; i < n; i++) {
        int status;
        wait_for(&next);
        clock_gettime(CLOCK_MONOTONIC, &before);
        status = hexapod_evaluate(&row[i].in, &out);
        clock_gettime(CLOCK_MONOTONIC, &after);
        took[i] = seconds_between(&before, &after);
        /* Here a controller adds its feedback and sends the sum to the drives. Without an answer `out` keeps the last one. */
        if (status != HEXAPOD_OK) {
            fprintf(stderr, "t = %g s: status %d\n", row[i].t, status);
            continue;
        }
        for (k = 0; k < HEXAPOD_N_ACTUATOR; k++) {
            largest = fmax(largest, fabs(row[i].force[k]));
            apart = fmax(apart, fabs(out.driving_force[k] - row[i].force[k]));
        }
    }

    qsort(took, (size_t)n, sizeof took[0], ascending);
    printf("%d periods of 1 ms\n", n);
    printf("largest driving force %.6g N, largest difference from linkdyn %.1e of it\n", largest, apart/largest);
    printf("time a call: median %.2f us, worst %.2f us\n", 1e6*took[n/2], 1e6*took[n - 1]);
    return 0;
}
