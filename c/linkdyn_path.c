#define _XOPEN_SOURCE 700
#include "linkdyn_path.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { most_links = 40 };    /* as many as Linux follows */

int linkdyn_to_c_path(const char *path, int path_len, char *c_path)
{
    if (path_len < 0 || path_len >= linkdyn_path_capacity) {
        errno = ENAMETOOLONG;
        return -1;
    }
    memcpy(c_path, path, (size_t)path_len);
    c_path[path_len] = '\0';
    return 0;
}

static void to_fortran(const char *text, char *to, int to_len)
{
    size_t length = strlen(text);

    if (length > (size_t)to_len) {
        length = (size_t)to_len;
    }
    memset(to, ' ', (size_t)to_len);
    memcpy(to, text, length);
}

int linkdyn_fail_with(int code, char *reason, int reason_len)
{
    to_fortran(strerror(code), reason, reason_len);
    return -1;
}

int linkdyn_own_descriptor(const char *c_path)
{
    const char *slash = strrchr(c_path, '/');
    const char *digits = slash ? slash + 1 : c_path;
    char own[64];
    struct stat link, own_link, target, own_target;

    if (*digits == '\0' || strlen(digits) > 9 || digits[strspn(digits, "0123456789")] != '\0') {
        return -1;
    }
    snprintf(own, sizeof own, "/proc/self/fd/%s", digits);
    if (lstat(c_path, &link) != 0 || lstat(own, &own_link) != 0 || stat(c_path, &target) != 0 || stat(own, &own_target) != 0) {
        return -1;
    }
    if (!S_ISLNK(link.st_mode) || link.st_dev != own_link.st_dev || target.st_dev != own_target.st_dev
        || target.st_ino != own_target.st_ino) {
        return -1;
    }
    return atoi(digits);
}

/* One link further: `path` becomes what the link says, beside the link if that is relative. */
static int follow_link(char *path)
{
    char said[linkdyn_path_capacity];
    ssize_t length = readlink(path, said, sizeof said - 1);
    char *slash = strrchr(path, '/');
    size_t folder = 0;

    if (length < 0) {
        return -1;
    }
    said[length] = '\0';
    if (said[0] != '/' && slash) {
        folder = (size_t)(slash - path) + 1;
    }
    if (folder + (size_t)length >= linkdyn_path_capacity) {
        errno = ENAMETOOLONG;
        return -1;
    }
    memcpy(path + folder, said, (size_t)length + 1);
    return 0;
}

int linkdyn_resolve(const char *path, int path_len, char *resolved, int resolved_len, char *reason, int reason_len)
{
    char here[linkdyn_path_capacity];
    struct stat entry;
    int n_link = 0;

    if (linkdyn_to_c_path(path, path_len, here) != 0) {
        linkdyn_fail_with(errno, reason, reason_len);
        return linkdyn_path_failed;
    }
    while (lstat(here, &entry) == 0 && S_ISLNK(entry.st_mode) && linkdyn_own_descriptor(here) < 0) {
        if (++n_link > most_links) {
            errno = ELOOP;
        }
        if (n_link > most_links || follow_link(here) != 0) {
            linkdyn_fail_with(errno, reason, reason_len);
            return linkdyn_path_failed;
        }
    }
    if (strlen(here) > (size_t)resolved_len) {
        linkdyn_fail_with(ENAMETOOLONG, reason, reason_len);
        return linkdyn_path_failed;
    }
    to_fortran(here, resolved, resolved_len);
    if (linkdyn_own_descriptor(here) >= 0) {
        return linkdyn_path_other;
    }
    if (lstat(here, &entry) != 0) {
        if (errno == ENOENT) {
            return linkdyn_path_missing;
        }
        linkdyn_fail_with(errno, reason, reason_len);
        return linkdyn_path_failed;
    }
    if (S_ISREG(entry.st_mode)) {
        return linkdyn_path_file;
    }
    return S_ISDIR(entry.st_mode) ? linkdyn_path_directory : linkdyn_path_other;
}

int linkdyn_path_exists(const char *path, int path_len)
{
    char c_path[linkdyn_path_capacity];
    struct stat entry;

    return linkdyn_to_c_path(path, path_len, c_path) == 0 && stat(c_path, &entry) == 0;
}

int linkdyn_is_same_file(const char *one, int one_len, const char *other, int other_len)
{
    char c_path[linkdyn_path_capacity];
    struct stat first, second;

    if (linkdyn_to_c_path(one, one_len, c_path) != 0 || stat(c_path, &first) != 0) {
        return 0;
    }
    if (linkdyn_to_c_path(other, other_len, c_path) != 0 || stat(c_path, &second) != 0) {
        return 0;
    }
    return first.st_dev == second.st_dev && first.st_ino == second.st_ino;
}

int linkdyn_is_inside(const char *file, int file_len, const char *folder, int folder_len)
{
    char c_path[linkdyn_path_capacity];
    char *real_file = NULL;
    char *real_folder = NULL;
    int answer = 0;

    if (linkdyn_to_c_path(file, file_len, c_path) == 0) {
        real_file = realpath(c_path, NULL);
    }
    if (linkdyn_to_c_path(folder, folder_len, c_path) == 0) {
        real_folder = realpath(c_path[0] == '\0' ? "." : c_path, NULL);
    }
    if (real_file && real_folder) {
        size_t length = strlen(real_folder);
        if (length == 1) {    /* the root: everything is inside */
            length = 0;
        }
        answer = strncmp(real_file, real_folder, length) == 0 && real_file[length] == '/';
    }
    free(real_file);
    free(real_folder);
    return answer;
}
