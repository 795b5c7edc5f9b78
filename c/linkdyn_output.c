#define _POSIX_C_SOURCE 200809L
#include "linkdyn_output.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { path_capacity = 4096, probe_size = 65536 };

static char guarded[path_capacity];
static volatile sig_atomic_t interrupt = 0;

static int to_c_path(const char *path, int path_len, char *c_path)
{
    if (path_len < 0 || path_len >= path_capacity) {
        errno = ENAMETOOLONG;
        return -1;
    }
    memcpy(c_path, path, (size_t)path_len);
    c_path[path_len] = '\0';
    return 0;
}

/* The text of `code` in a Fortran string. */
static int fail_with(int code, char *reason, int reason_len)
{
    const char *text = strerror(code);
    size_t length = strlen(text);

    if (length > (size_t)reason_len) {
        length = (size_t)reason_len;
    }
    memset(reason, ' ', (size_t)reason_len);
    memcpy(reason, text, length);
    return -1;
}

int linkdyn_path_kind(const char *path, int path_len)
{
    char c_path[path_capacity];
    struct stat entry;

    if (to_c_path(path, path_len, c_path) != 0 || stat(c_path, &entry) != 0) {
        return linkdyn_path_missing;
    }
    if (S_ISREG(entry.st_mode)) {
        return linkdyn_path_file;
    }
    return S_ISDIR(entry.st_mode) ? linkdyn_path_directory : linkdyn_path_other;
}

int linkdyn_open_write(const char *path, int path_len, char *reason, int reason_len)
{
    char c_path[path_capacity];

    if (to_c_path(path, path_len, c_path) != 0) {
        return fail_with(errno, reason, reason_len);
    }
    int descriptor = open(c_path, O_WRONLY | O_CREAT | O_TRUNC, 0666);
    return descriptor >= 0 ? descriptor : fail_with(errno, reason, reason_len);
}

int linkdyn_write_text(int descriptor, const char *text, int text_len, char *reason, int reason_len)
{
    size_t left = (size_t)text_len;

    while (left > 0) {
        ssize_t written = write(descriptor, text, left);
        if (written < 0) {
            if (errno == EINTR) {
                continue;
            }
            return fail_with(errno, reason, reason_len);
        }
        text += written;
        left -= (size_t)written;
    }
    return 0;
}

int linkdyn_close_write(int descriptor, char *reason, int reason_len)
{
    return close(descriptor) == 0 ? 0 : fail_with(errno, reason, reason_len);
}

int linkdyn_open_update(const char *path, int path_len, char *reason, int reason_len)
{
    char c_path[path_capacity];

    if (to_c_path(path, path_len, c_path) != 0) {
        return fail_with(errno, reason, reason_len);
    }
    int descriptor = open(c_path, O_RDWR | O_CREAT, 0666);
    return descriptor >= 0 ? descriptor : fail_with(errno, reason, reason_len);
}

int linkdyn_write_at(int descriptor, int64_t offset, const void *bytes, int64_t n, char *reason, int reason_len)
{
    const char *next = bytes;

    while (n > 0) {
        ssize_t written = pwrite(descriptor, next, (size_t)n, (off_t)offset);
        if (written < 0) {
            if (errno == EINTR) {
                continue;
            }
            return fail_with(errno, reason, reason_len);
        }
        next += written;
        offset += written;
        n -= written;
    }
    return 0;
}

int linkdyn_read_at(int descriptor, int64_t offset, void *bytes, int64_t n, char *reason, int reason_len)
{
    char *next = bytes;

    while (n > 0) {
        ssize_t taken = pread(descriptor, next, (size_t)n, (off_t)offset);
        if (taken < 0 && errno == EINTR) {
            continue;
        }
        if (taken <= 0) {
            return fail_with(taken < 0 ? errno : EIO, reason, reason_len);
        }
        next += taken;
        offset += taken;
        n -= taken;
    }
    return 0;
}

int linkdyn_sync(int descriptor, char *reason, int reason_len)
{
    return fsync(descriptor) == 0 ? 0 : fail_with(errno, reason, reason_len);
}

int linkdyn_probe_write(const char *path, int path_len, int n_block, char *reason, int reason_len)
{
    static const char zeros[probe_size];
    char c_path[path_capacity];
    int outcome = 0;

    if (to_c_path(path, path_len, c_path) != 0) {
        return fail_with(errno, reason, reason_len);
    }
    int descriptor = open(c_path, O_WRONLY | O_CREAT | O_APPEND, 0666);
    if (descriptor < 0) {
        return fail_with(errno, reason, reason_len);
    }
    for (int i = 0; i < n_block && outcome == 0; i++) {
        outcome = linkdyn_write_text(descriptor, zeros, probe_size, reason, reason_len);
    }
    if (outcome == 0 && fsync(descriptor) != 0 && errno != EINVAL) {
        outcome = fail_with(errno, reason, reason_len);
    }
    close(descriptor);
    return outcome;
}

int linkdyn_replace_file(const char *from, int from_len, const char *to, int to_len, char *reason, int reason_len)
{
    char c_from[path_capacity];
    char c_to[path_capacity];
    int code = 0;

    if (to_c_path(from, from_len, c_from) != 0 || to_c_path(to, to_len, c_to) != 0) {
        return fail_with(errno, reason, reason_len);
    }
    int file = open(c_from, O_RDWR);
    if (file < 0) {
        return fail_with(errno, reason, reason_len);
    }
    if (fsync(file) != 0) {    /* a full disk may show only here */
        code = errno;
    }
    if (close(file) != 0 && code == 0) {
        code = errno;
    }
    if (code == 0 && rename(c_from, c_to) != 0) {
        code = errno;
    }
    return code == 0 ? 0 : fail_with(code, reason, reason_len);
}

void linkdyn_remove_file(const char *path, int path_len)
{
    char c_path[path_capacity];

    if (to_c_path(path, path_len, c_path) == 0) {
        unlink(c_path);
    }
}

static void remove_guarded(int signal_number)
{
    if (guarded[0] != '\0') {
        unlink(guarded);
    }
    signal(signal_number, SIG_DFL);
    raise(signal_number);
}

void linkdyn_guard_file(const char *path, int path_len)
{
    if (path_len == 0) {
        guarded[0] = '\0';
        return;
    }
    if (to_c_path(path, path_len, guarded) != 0) {
        guarded[0] = '\0';
        return;
    }
    signal(SIGINT, remove_guarded);
    signal(SIGTERM, remove_guarded);
    signal(SIGHUP, remove_guarded);
    signal(SIGXFSZ, SIG_IGN);    /* beyond the allowed file size: a write error like any other */
}

/* The second time the program ends at once. */
static void note_interrupt(int signal_number)
{
    interrupt = signal_number;
    signal(signal_number, remove_guarded);
}

void linkdyn_watch_interrupts(void)
{
    signal(SIGINT, note_interrupt);
    signal(SIGTERM, note_interrupt);
}

int linkdyn_interrupt(void)
{
    return interrupt;
}

int linkdyn_is_terminal(int descriptor)
{
    return isatty(descriptor);
}

int linkdyn_process_id(void)
{
    return (int)getpid();
}

void linkdyn_leave(int status)
{
    _exit(status);
}
