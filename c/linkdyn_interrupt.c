#define _GNU_SOURCE
#include "linkdyn_interrupt.h"

#include "linkdyn_path.h"

#include <pthread.h>
#include <signal.h>
#include <stddef.h>
#include <string.h>
#include <unistd.h>

#ifdef __linux__
#include <sys/syscall.h>
#endif

static char guarded[linkdyn_path_capacity];
static volatile sig_atomic_t child = 0;
static volatile sig_atomic_t noted = 0;
static struct sigaction host;
static volatile sig_atomic_t is_listening = 0;
static _Thread_local int has_started = 0;    /* this thread, which spares the end of a call asking the system which one it is */

/* nohup, and a shell that starts us in the background, ignore signals for us: they stay ignored. */
static void set_handler(int signal_number, void (*handler)(int))
{
    struct sigaction action;

    if (sigaction(signal_number, NULL, &action) != 0 || action.sa_handler == SIG_IGN) {
        return;
    }
    memset(&action, 0, sizeof action);
    action.sa_handler = handler;
    action.sa_flags = SA_RESTART;
    sigemptyset(&action.sa_mask);
    sigaction(signal_number, &action, NULL);
}

static void leave_nothing(int signal_number)
{
    if (guarded[0] != '\0') {
        unlink(guarded);
    }
    if (child > 0) {
        kill((pid_t)child, SIGTERM);
    }
    signal(signal_number, SIG_DFL);
    raise(signal_number);
}

/* The second time the program ends at once. */
static void note_interrupt(int signal_number)
{
    noted = signal_number;
    set_handler(signal_number, leave_nothing);
}

void linkdyn_settle_signals(void)
{
    signal(SIGXFSZ, SIG_IGN);
}

static void expect_the_end(void)
{
    static const int ends[] = {SIGINT, SIGTERM, SIGHUP};
    struct sigaction action;

    for (size_t i = 0; i < sizeof ends / sizeof *ends; i++) {
        if (sigaction(ends[i], NULL, &action) == 0 && action.sa_handler == SIG_DFL) {
            set_handler(ends[i], leave_nothing);
        }
    }
}

void linkdyn_guard_file(const char *path, int path_len)
{
    sigset_t all, before;

    /* a handler must not meet half a name */
    sigfillset(&all);
    pthread_sigmask(SIG_BLOCK, &all, &before);
    if (path_len == 0 || linkdyn_to_c_path(path, path_len, guarded) != 0) {
        guarded[0] = '\0';
    }
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    expect_the_end();
}

void linkdyn_guard_child(int process)
{
    child = process;
    expect_the_end();
}

void linkdyn_watch_interrupts(void)
{
    set_handler(SIGINT, note_interrupt);
    set_handler(SIGTERM, note_interrupt);
}

int linkdyn_noted_interrupt(void)
{
    return noted;
}

static int is_main_thread(void)
{
#ifdef __linux__
    return syscall(SYS_gettid) == getpid();
#else
    return pthread_main_np() != 0;
#endif
}

static void note_and_pass(int signal_number, siginfo_t *info, void *context)
{
    noted = signal_number;
    if (host.sa_flags & SA_SIGINFO) {
        host.sa_sigaction(signal_number, info, context);
    } else {
        host.sa_handler(signal_number);
    }
}

void linkdyn_start_listening(void)
{
    struct sigaction own;

    if (!is_main_thread()) {
        return;
    }
    has_started = 1;
    noted = 0;
    if (sigaction(SIGINT, NULL, &host) != 0 || host.sa_handler == SIG_DFL || host.sa_handler == SIG_IGN) {
        return;    /* ends the process, or does nothing */
    }
    own = host;
    own.sa_sigaction = note_and_pass;
    own.sa_flags |= SA_SIGINFO;
    is_listening = sigaction(SIGINT, &own, NULL) == 0;
}

void linkdyn_stop_listening(void)
{
    if (!has_started) {
        return;
    }
    has_started = 0;
    if (is_listening) {
        sigaction(SIGINT, &host, NULL);
    }
    is_listening = 0;
    noted = 0;
}
