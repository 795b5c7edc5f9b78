/* Another program, run with a text to read and asked for a text. */
#ifndef LINKDYN_CHILD_H
#define LINKDYN_CHILD_H

#include <stdint.h>

/* Run a program: `words` are its name and arguments, each ended by 0. It reads `input` and what it prints comes back (free
 * with linkdyn_file_free). Its exit status; -1: it could not be run, or a signal ended it. It ends when a signal ends us. */
int linkdyn_run_program(const char *words, int n_word, const char *input, int64_t input_len, char **output, int64_t *size);

#endif
