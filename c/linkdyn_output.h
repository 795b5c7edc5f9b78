/* What Fortran's own I/O cannot say or do about a file to be written: why a write fails, a part that nobody else has, and
 * putting a finished file in its place in one step. Paths come with their length, not ended by 0.
 *
 * Procedures return 0 or a descriptor, or -1 with the system's reason, blank padded. */
#ifndef LINKDYN_OUTPUT_H
#define LINKDYN_OUTPUT_H

#include <stdint.h>

/* The name of a part beside its target, blank padded: it tells whose it is, lest another run takes it for its own. */
void linkdyn_name_part(const char *target, int target_len, char *part, int part_len);

/* Remove the parts of this target that processes of this machine left behind when they were killed. */
void linkdyn_remove_leftovers(const char *target, int target_len);

/* A new part: nothing may be there, and no link is followed. It gets the permissions of the target, which must be writable
 * if it is there. */
int linkdyn_open_part(const char *part, int part_len, const char *target, int target_len, char *reason, int reason_len);

/* A device, a pipe, or one of our own descriptors, to write through to. */
int linkdyn_open_through(const char *path, int path_len, char *reason, int reason_len);

/* A scratch file in TMPDIR or /tmp: its name, blank padded. */
int linkdyn_open_scratch(char *path, int path_len, char *reason, int reason_len);

/* The whole text. libgfortran does not report a full disk, so it does not write here. */
int linkdyn_write_text(int descriptor, const char *text, int text_len, char *reason, int reason_len);

/* All that a file holds. */
int linkdyn_copy_file(const char *from, int from_len, int descriptor, char *reason, int reason_len);

int linkdyn_close_write(int descriptor, char *reason, int reason_len);

/* Append so many blocks of 64 KiB to a file, send them to the disk, and take them off again. */
int linkdyn_probe_write(const char *path, int path_len, int n_block, char *reason, int reason_len);

/* Bring `from` to the disk and rename it to `to`, which is a file or not there. */
int linkdyn_replace_file(const char *from, int from_len, const char *to, int to_len, char *reason, int reason_len);

/* A file to be written and read at any place: a new one in place of what was there, or the one that is there. No link is
 * followed. */
int linkdyn_open_update(const char *path, int path_len, int is_new, char *reason, int reason_len);

/* All n bytes at an offset. Reading beyond the end is a failure. */
int linkdyn_write_at(int descriptor, int64_t offset, const void *bytes, int64_t n, char *reason, int reason_len);
int linkdyn_read_at(int descriptor, int64_t offset, void *bytes, int64_t n, char *reason, int reason_len);

/* Everything written so far is on the disk. */
int linkdyn_sync(int descriptor, char *reason, int reason_len);

/* Hold a lock file until it is released or the process ends: its descriptor; -2: another process has it, and says in `reason`
 * which. Where the file system knows no locks there is none, and the descriptor is all the same. */
int linkdyn_lock(const char *path, int path_len, char *reason, int reason_len);
void linkdyn_unlock(int descriptor, const char *path, int path_len);

void linkdyn_remove_file(const char *path, int path_len);

int linkdyn_is_terminal(int descriptor);

/* Bits that no other call has given, here or elsewhere. */
int64_t linkdyn_fresh_bits(void);

/* End the process without the exit handlers of libraries. */
void linkdyn_leave(int status);

#endif
