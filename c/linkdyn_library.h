/* The library's version, and why the last call of a thread failed: see linkdyn.h. */
#ifndef LINKDYN_LIBRARY_H
#define LINKDYN_LIBRARY_H

#include <stddef.h>

/* Texts of Fortran are not terminated; one that is too long is cut. */
void linkdyn_note_error(const char *text, size_t size);

const char *linkdyn_last_error(void);
const char *linkdyn_version(void);

#endif
