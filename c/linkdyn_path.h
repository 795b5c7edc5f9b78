/* File names: what they stand for once links are followed. Paths from Fortran come with their length, not ended by 0. */
#ifndef LINKDYN_PATH_H
#define LINKDYN_PATH_H

enum { linkdyn_path_capacity = 4096 };

enum linkdyn_path_kind {
    linkdyn_path_missing = 0,
    linkdyn_path_file = 1,
    linkdyn_path_directory = 2,
    linkdyn_path_other = 3,    /* device, pipe, socket, or one of our own descriptors such as /dev/stdout */
    linkdyn_path_failed = 4    /* the system says why */
};

/* For the other files of this folder: a name ended by 0 (0, or -1 with errno), and the text of a code in a Fortran string (-1). */
int linkdyn_to_c_path(const char *path, int path_len, char *c_path);
int linkdyn_fail_with(int code, char *reason, int reason_len);

/* The number of our own descriptor that a name such as /proc/self/fd/1 stands for; -1: none. */
int linkdyn_own_descriptor(const char *c_path);

/* What a name stands for, and the name behind all links, blank padded; it need not be there. */
int linkdyn_resolve(const char *path, int path_len, char *resolved, int resolved_len, char *reason, int reason_len);

int linkdyn_path_exists(const char *path, int path_len);

/* 1: both are there and are the same file, by whatever names. */
int linkdyn_is_same_file(const char *one, int one_len, const char *other, int other_len);

/* 1: the file lies in the folder (blank: the current one) or below it, links followed. */
int linkdyn_is_inside(const char *file, int file_len, const char *folder, int folder_len);

#endif
