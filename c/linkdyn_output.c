#define _GNU_SOURCE
#include "linkdyn_output.h"

#include "linkdyn_path.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

enum { probe_size = 65536, host_capacity = 65 };

static const char part_ending[] = ".part";

static void host_name(char *name)
{
    if (gethostname(name, host_capacity) != 0) {
        strcpy(name, "localhost");
    }
    name[host_capacity - 1] = '\0';
}

void linkdyn_name_part(const char *target, int target_len, char *part, int part_len)
{
    char host[host_capacity];
    char name[linkdyn_path_capacity + 2 * host_capacity];
    size_t length;

    host_name(host);
    snprintf(name, sizeof name, "%.*s.%ld@%s%s", target_len, target, (long)getpid(), host, part_ending);
    length = strlen(name);
    memset(part, ' ', (size_t)part_len);
    memcpy(part, name, length < (size_t)part_len ? length : (size_t)part_len);
}

/* `rest` is what follows the target's name in that of a part: ".PID@HOST.part" of a process that is gone. */
static int is_leftover(const char *rest)
{
    char host[host_capacity];
    char *end;
    long process;
    size_t length;

    if (rest[0] != '.') {
        return 0;
    }
    process = strtol(rest + 1, &end, 10);
    host_name(host);
    length = strlen(host);
    if (end == rest + 1 || process <= 0 || *end != '@' || strncmp(end + 1, host, length) != 0) {
        return 0;
    }
    if (strcmp(end + 1 + length, part_ending) != 0) {
        return 0;
    }
    return process == (long)getpid() || (kill((pid_t)process, 0) != 0 && errno == ESRCH);
}

void linkdyn_remove_leftovers(const char *target, int target_len)
{
    char name[linkdyn_path_capacity];
    char *base = name;
    char *slash;
    DIR *folder;
    struct dirent *entry;
    size_t length;

    if (linkdyn_to_c_path(target, target_len, name) != 0) {
        return;
    }
    slash = strrchr(name, '/');
    if (slash) {
        base = slash + 1;
        folder = slash == name ? opendir("/") : (*slash = '\0', opendir(name));
    } else {
        folder = opendir(".");
    }
    if (!folder) {
        return;
    }
    length = strlen(base);
    while ((entry = readdir(folder)) != NULL) {
        if (strncmp(entry->d_name, base, length) == 0 && is_leftover(entry->d_name + length)) {
            unlinkat(dirfd(folder), entry->d_name, 0);
        }
    }
    closedir(folder);
}

int linkdyn_open_part(const char *part, int part_len, const char *target, int target_len, char *reason, int reason_len)
{
    char c_part[linkdyn_path_capacity];
    char c_target[linkdyn_path_capacity];
    struct stat entry;
    int is_there, descriptor;

    if (linkdyn_to_c_path(part, part_len, c_part) != 0 || linkdyn_to_c_path(target, target_len, c_target) != 0) {
        return linkdyn_fail_with(errno, reason, reason_len);
    }
    is_there = stat(c_target, &entry) == 0;
    if (is_there && access(c_target, W_OK) != 0) {
        return linkdyn_fail_with(errno, reason, reason_len);
    }
    descriptor = open(c_part, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor < 0) {
        return linkdyn_fail_with(errno, reason, reason_len);
    }
    if (is_there) {
        fchmod(descriptor, entry.st_mode & 0777);
    }
    return descriptor;
}

int linkdyn_open_through(const char *path, int path_len, char *reason, int reason_len)
{
    char c_path[linkdyn_path_capacity];
    int own, descriptor;

    if (linkdyn_to_c_path(path, path_len, c_path) != 0) {
        return linkdyn_fail_with(errno, reason, reason_len);
    }
    signal(SIGPIPE, SIG_IGN);    /* a reader that has left is a write error */
    own = linkdyn_own_descriptor(c_path);
    descriptor = own >= 0 ? dup(own) : open(c_path, O_WRONLY | O_NOCTTY | O_CLOEXEC);
    return descriptor >= 0 ? descriptor : linkdyn_fail_with(errno, reason, reason_len);
}

int linkdyn_open_scratch(char *path, int path_len, char *reason, int reason_len)
{
    char name[linkdyn_path_capacity];
    const char *folder = getenv("TMPDIR");
    int descriptor;

    snprintf(name, sizeof name, "%s/linkdyn.XXXXXX", folder && *folder ? folder : "/tmp");
    if (strlen(name) > (size_t)path_len) {
        return linkdyn_fail_with(ENAMETOOLONG, reason, reason_len);
    }
    descriptor = mkostemp(name, O_CLOEXEC);
    if (descriptor < 0) {
        return linkdyn_fail_with(errno, reason, reason_len);
    }
    memset(path, ' ', (size_t)path_len);
    memcpy(path, name, strlen(name));
    return descriptor;
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
            return linkdyn_fail_with(errno, reason, reason_len);
        }
        text += written;
        left -= (size_t)written;
    }
    return 0;
}

int linkdyn_copy_file(const char *from, int from_len, int descriptor, char *reason, int reason_len)
{
    char c_from[linkdyn_path_capacity];
    char bytes[probe_size];
    ssize_t taken;
    int outcome = 0;

    if (linkdyn_to_c_path(from, from_len, c_from) != 0) {
        return linkdyn_fail_with(errno, reason, reason_len);
    }
    int source = open(c_from, O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
    if (source < 0) {
        return linkdyn_fail_with(errno, reason, reason_len);
    }
    while (outcome == 0 && (taken = read(source, bytes, sizeof bytes)) != 0) {
        if (taken > 0) {
            outcome = linkdyn_write_text(descriptor, bytes, (int)taken, reason, reason_len);
        } else if (errno != EINTR) {
            outcome = linkdyn_fail_with(errno, reason, reason_len);
        }
    }
    close(source);
    return outcome;
}

int linkdyn_close_write(int descriptor, char *reason, int reason_len)
{
    return close(descriptor) == 0 ? 0 : linkdyn_fail_with(errno, reason, reason_len);
}

int linkdyn_open_update(const char *path, int path_len, int is_new, char *reason, int reason_len)
{
    char c_path[linkdyn_path_capacity];
    int descriptor;

    if (linkdyn_to_c_path(path, path_len, c_path) != 0) {
        return linkdyn_fail_with(errno, reason, reason_len);
    }
    if (is_new && unlink(c_path) != 0 && errno != ENOENT) {
        return linkdyn_fail_with(errno, reason, reason_len);
    }
    descriptor = open(c_path, O_RDWR | O_NOFOLLOW | O_CLOEXEC | (is_new ? O_CREAT | O_EXCL : 0), 0666);
    return descriptor >= 0 ? descriptor : linkdyn_fail_with(errno, reason, reason_len);
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
            return linkdyn_fail_with(errno, reason, reason_len);
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
            return linkdyn_fail_with(taken < 0 ? errno : EIO, reason, reason_len);
        }
        next += taken;
        offset += taken;
        n -= taken;
    }
    return 0;
}

int linkdyn_sync(int descriptor, char *reason, int reason_len)
{
    return fsync(descriptor) == 0 ? 0 : linkdyn_fail_with(errno, reason, reason_len);
}

int linkdyn_probe_write(const char *path, int path_len, int n_block, char *reason, int reason_len)
{
    static const char zeros[probe_size];
    char c_path[linkdyn_path_capacity];
    struct stat entry;
    int outcome = 0;

    if (linkdyn_to_c_path(path, path_len, c_path) != 0) {
        return linkdyn_fail_with(errno, reason, reason_len);
    }
    int descriptor = open(c_path, O_WRONLY | O_APPEND | O_NOFOLLOW | O_CLOEXEC);
    if (descriptor < 0 || fstat(descriptor, &entry) != 0) {
        return linkdyn_fail_with(errno, reason, reason_len);
    }
    for (int i = 0; i < n_block && outcome == 0; i++) {
        outcome = linkdyn_write_text(descriptor, zeros, probe_size, reason, reason_len);
    }
    if (outcome == 0 && fsync(descriptor) != 0 && errno != EINVAL) {
        outcome = linkdyn_fail_with(errno, reason, reason_len);
    }
    if (ftruncate(descriptor, entry.st_size) != 0 && outcome == 0) {
        outcome = linkdyn_fail_with(errno, reason, reason_len);
    }
    close(descriptor);
    return outcome;
}

int linkdyn_replace_file(const char *from, int from_len, const char *to, int to_len, char *reason, int reason_len)
{
    char c_from[linkdyn_path_capacity];
    char c_to[linkdyn_path_capacity];
    struct stat entry;
    int code = 0;

    if (linkdyn_to_c_path(from, from_len, c_from) != 0 || linkdyn_to_c_path(to, to_len, c_to) != 0) {
        return linkdyn_fail_with(errno, reason, reason_len);
    }
    int file = open(c_from, O_RDWR | O_NOFOLLOW | O_CLOEXEC);
    if (file < 0) {
        return linkdyn_fail_with(errno, reason, reason_len);
    }
    if (fsync(file) != 0) {    /* a full disk may show only here */
        code = errno;
    }
    if (close(file) != 0 && code == 0) {
        code = errno;
    }
    if (code == 0 && lstat(c_to, &entry) == 0 && !S_ISREG(entry.st_mode)) {
        code = EEXIST;    /* it came while we were writing */
    }
    if (code == 0 && rename(c_from, c_to) != 0) {
        code = errno;
    }
    return code == 0 ? 0 : linkdyn_fail_with(code, reason, reason_len);
}

/* Who holds the lock, as its holder wrote it down. */
static int tell_holder(int descriptor, char *reason, int reason_len)
{
    ssize_t length;

    memset(reason, ' ', (size_t)reason_len);
    length = pread(descriptor, reason, (size_t)reason_len, 0);
    for (ssize_t i = 0; i < length; i++) {
        if (reason[i] == '\n') {
            reason[i] = ' ';
        }
    }
    return -2;
}

int linkdyn_lock(const char *path, int path_len, char *reason, int reason_len)
{
    char c_path[linkdyn_path_capacity];
    char host[host_capacity];
    char holder[64 + host_capacity];

    if (linkdyn_to_c_path(path, path_len, c_path) != 0) {
        return linkdyn_fail_with(errno, reason, reason_len);
    }
    for (;;) {
        struct stat held, named;
        int descriptor = open(c_path, O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0666);
        if (descriptor < 0) {
            return linkdyn_fail_with(errno, reason, reason_len);
        }
        if (flock(descriptor, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
            int outcome = tell_holder(descriptor, reason, reason_len);
            close(descriptor);
            return outcome;
        }
        /* its last holder may have removed it between the two calls */
        if (fstat(descriptor, &held) == 0 && lstat(c_path, &named) == 0 && held.st_ino == named.st_ino
            && held.st_dev == named.st_dev) {
            host_name(host);
            int length = snprintf(holder, sizeof holder, "process %ld on %s\n", (long)getpid(), host);
            if (ftruncate(descriptor, 0) != 0 || pwrite(descriptor, holder, (size_t)length, 0) != length) {
                int code = errno ? errno : ENOSPC;
                linkdyn_unlock(descriptor, path, path_len);
                return linkdyn_fail_with(code, reason, reason_len);
            }
            return descriptor;
        }
        close(descriptor);
    }
}

void linkdyn_unlock(int descriptor, const char *path, int path_len)
{
    linkdyn_remove_file(path, path_len);    /* before the lock is gone: the next holder makes one of its own */
    close(descriptor);
}

void linkdyn_remove_file(const char *path, int path_len)
{
    char c_path[linkdyn_path_capacity];

    if (linkdyn_to_c_path(path, path_len, c_path) == 0) {
        unlink(c_path);
    }
}

int linkdyn_is_terminal(int descriptor)
{
    return isatty(descriptor);
}

int64_t linkdyn_fresh_bits(void)
{
    int64_t bits;
    struct timespec now;

    if (getrandom(&bits, sizeof bits, GRND_NONBLOCK) == (ssize_t)sizeof bits) {
        return bits;
    }
    clock_gettime(CLOCK_REALTIME, &now);    /* early in the boot of a machine */
    return ((int64_t)getpid() << 40) ^ (int64_t)now.tv_sec ^ ((int64_t)now.tv_nsec << 20);
}

void linkdyn_leave(int status)
{
    _exit(status);
}
