#include "linkdyn_blas.h"

#include <pthread.h>

/* weak: another BLAS does not have them */
extern void openblas_set_num_threads(int n) __attribute__((weak));
extern int openblas_get_num_threads(void) __attribute__((weak));

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static int n_holder;
static int n_before;

void linkdyn_hold_blas(void)
{
    if (!openblas_set_num_threads || !openblas_get_num_threads) {
        return;
    }
    pthread_mutex_lock(&lock);
    if (n_holder++ == 0) {
        n_before = openblas_get_num_threads();
        if (n_before > 1) {
            openblas_set_num_threads(1);
        }
    }
    pthread_mutex_unlock(&lock);
}

void linkdyn_release_blas(void)
{
    if (!openblas_set_num_threads || !openblas_get_num_threads) {
        return;
    }
    pthread_mutex_lock(&lock);
    if (--n_holder == 0 && n_before > 1) {
        openblas_set_num_threads(n_before);
    }
    pthread_mutex_unlock(&lock);
}
