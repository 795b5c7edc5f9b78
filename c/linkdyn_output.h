/* What Fortran's own I/O cannot say about a file to be written: its kind, why a write fails, and
 * putting a finished file in its place in one step. Paths come with their length, not ended by 0. */
#ifndef LINKDYN_OUTPUT_H
#define LINKDYN_OUTPUT_H

#include <stdint.h>

enum linkdyn_path_kind {
    linkdyn_path_missing = 0,
    linkdyn_path_file = 1,
    linkdyn_path_directory = 2,
    linkdyn_path_other = 3    /* device, pipe, socket */
};

int linkdyn_path_kind(const char *path, int path_len);

/* A file for writing, emptied if it is there: its descriptor, or -1 with the system's reason, blank padded. */
int linkdyn_open_write(const char *path, int path_len, char *reason, int reason_len);

/* The whole text; 0, or -1 with the reason. libgfortran does not report a full disk, so it does not write here. */
int linkdyn_write_text(int descriptor, const char *text, int text_len, char *reason, int reason_len);

/* 0, or -1 with the reason. */
int linkdyn_close_write(int descriptor, char *reason, int reason_len);

/* Append so many blocks of 64 KiB and send them to the disk; 0, or -1 with the system's reason, blank padded. */
int linkdyn_probe_write(const char *path, int path_len, int n_block, char *reason, int reason_len);

/* Bring `from` to the disk and rename it to `to`; 0, or -1 with the system's reason. */
int linkdyn_replace_file(const char *from, int from_len, const char *to, int to_len, char *reason, int reason_len);

/* A file to be written and read at any place, kept as it is if it is there: its descriptor, or -1 with the reason. */
int linkdyn_open_update(const char *path, int path_len, char *reason, int reason_len);

/* All n bytes at an offset; 0, or -1 with the reason. Reading beyond the end is a failure. */
int linkdyn_write_at(int descriptor, int64_t offset, const void *bytes, int64_t n, char *reason, int reason_len);
int linkdyn_read_at(int descriptor, int64_t offset, void *bytes, int64_t n, char *reason, int reason_len);

/* Everything written so far is on the disk; 0, or -1 with the reason. */
int linkdyn_sync(int descriptor, char *reason, int reason_len);

void linkdyn_remove_file(const char *path, int path_len);

/* Remove this file if the process is interrupted; length 0 ends the watch. */
void linkdyn_guard_file(const char *path, int path_len);

/* From now on the first SIGINT or SIGTERM is only noted; a second one ends the program. */
void linkdyn_watch_interrupts(void);

/* Number of the signal noted; 0: none. */
int linkdyn_interrupt(void);

int linkdyn_is_terminal(int descriptor);
int linkdyn_process_id(void);

/* End the process without the exit handlers of libraries. */
void linkdyn_leave(int status);

#endif
