#define _POSIX_C_SOURCE 200809L
#include "linkdyn_threads.h"

#include <pthread.h>
#include <stdatomic.h>
#include <unistd.h>

/* More threads than processors gain nothing, but somebody may want to see that results do not depend on their number:
 * a few are never refused. OpenMP ends the process when the system will not start so many as it was told to. */
enum { always_granted = 16, each_processor = 2 };

static pthread_once_t once = PTHREAD_ONCE_INIT;
static atomic_int had_team = 0;
static atomic_int is_orphan = 0;

/* Of the threads that wait for work in OpenMP's pool only their master goes along into a forked process: it would wait
 * for the others for ever. */
static void note_child(void)
{
    if (had_team) {
        is_orphan = 1;
    }
}

static void watch_forks(void)
{
    pthread_atfork(NULL, NULL, note_child);
}

int linkdyn_team_size(int wanted, int n_task)
{
    int size = wanted < n_task ? wanted : n_task;

    /* only for many: to count processors, the system opens a file, which takes as long as a sample's forces */
    if (size > always_granted) {
        const long most = each_processor * sysconf(_SC_NPROCESSORS_ONLN);
        if (size > most) {
            size = most < always_granted ? always_granted : (int)most;
        }
    }
    if (size <= 1 || is_orphan) {
        return 1;
    }
    pthread_once(&once, watch_forks);
    had_team = 1;
    return size;
}
