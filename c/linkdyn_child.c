#define _XOPEN_SOURCE 700
#include "linkdyn_child.h"

#include "linkdyn_interrupt.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

enum { most_words = 32, first_room = 65536 };

static void close_both(const int ends[2])
{
    close(ends[0]);
    close(ends[1]);
}

static int open_pipe(int ends[2])
{
    if (pipe(ends) != 0) {
        return -1;
    }
    fcntl(ends[0], F_SETFD, FD_CLOEXEC);
    fcntl(ends[1], F_SETFD, FD_CLOEXEC);
    return 0;
}

static void write_all(int descriptor, const char *text, int64_t length)
{
    struct sigaction ignored, before;

    memset(&ignored, 0, sizeof ignored);
    ignored.sa_handler = SIG_IGN;    /* a program that does not read to the end says so by its status */
    sigaction(SIGPIPE, &ignored, &before);
    while (length > 0) {
        ssize_t written = write(descriptor, text, (size_t)length);
        if (written < 0 && errno != EINTR) {
            break;
        }
        if (written > 0) {
            text += written;
            length -= written;
        }
    }
    sigaction(SIGPIPE, &before, NULL);
}

static int read_to_end(int descriptor, char **output, int64_t *size)
{
    size_t capacity = first_room;
    size_t used = 0;
    char *buffer = malloc(capacity);

    while (buffer) {
        ssize_t taken = read(descriptor, buffer + used, capacity - used);
        if (taken == 0) {
            *output = buffer;
            *size = (int64_t)used;
            return 0;
        }
        if (taken < 0 && errno != EINTR) {
            break;
        }
        used += taken > 0 ? (size_t)taken : 0;
        if (used == capacity) {
            char *larger = realloc(buffer, 2 * capacity);
            if (!larger) {
                break;
            }
            buffer = larger;
            capacity *= 2;
        }
    }
    free(buffer);
    return -1;
}

/* Signals that end this program wait until it knows whom to end with it. */
static int start(char *const *arguments, const int input[2], const int output[2], pid_t *child)
{
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    sigset_t ending, before;
    int outcome;

    if (posix_spawn_file_actions_init(&actions) != 0) {
        return -1;
    }
    if (posix_spawnattr_init(&attributes) != 0) {
        posix_spawn_file_actions_destroy(&actions);
        return -1;
    }
    sigemptyset(&ending);
    sigaddset(&ending, SIGINT);
    sigaddset(&ending, SIGTERM);
    sigaddset(&ending, SIGHUP);
    pthread_sigmask(SIG_BLOCK, &ending, &before);
    posix_spawnattr_setsigmask(&attributes, &before);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
    posix_spawn_file_actions_adddup2(&actions, input[0], STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&actions, output[1], STDOUT_FILENO);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
    outcome = posix_spawn(child, arguments[0], &actions, &attributes, arguments, environ);
    if (outcome == 0) {
        linkdyn_guard_child((int)*child);
    }
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
    return outcome;
}

int linkdyn_run_program(const char *words, int n_word, const char *input, int64_t input_len, char **output, int64_t *size)
{
    char *arguments[most_words + 1];
    int to_child[2], from_child[2];
    pid_t child;
    int outcome, status;

    *output = NULL;
    *size = 0;
    if (n_word < 1 || n_word > most_words || open_pipe(to_child) != 0) {
        return -1;
    }
    if (open_pipe(from_child) != 0) {
        close_both(to_child);
        return -1;
    }
    for (int i = 0; i < n_word; i++) {
        arguments[i] = (char *)words;    /* exec takes them as they are */
        words += strlen(words) + 1;
    }
    arguments[n_word] = NULL;
    outcome = start(arguments, to_child, from_child, &child);
    close(to_child[0]);
    close(from_child[1]);
    if (outcome == 0) {
        write_all(to_child[1], input, input_len);
    }
    close(to_child[1]);
    if (outcome == 0) {
        outcome = read_to_end(from_child[0], output, size);
        close(from_child[0]);
        while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
        }
        linkdyn_guard_child(0);
        return outcome == 0 && WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    }
    close(from_child[0]);
    return -1;
}
