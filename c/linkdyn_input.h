/* Reading whole files, reading and writing decimal numbers: what Fortran's own I/O does too slowly, or
 * differently from one locale to the next. */
#ifndef LINKDYN_INPUT_H
#define LINKDYN_INPUT_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum linkdyn_file_outcome {
    linkdyn_file_ok = 0,
    linkdyn_file_missing = 1,
    linkdyn_file_directory = 2,
    linkdyn_file_denied = 3,
    linkdyn_file_failed = 4
};

/* The whole file in memory (free with linkdyn_file_free); works for pipes too. */
int linkdyn_file_read(const char *path, int path_len, char **data, int64_t *size, char *message, int message_len);
void linkdyn_file_free(char *data);

/* The decimal number at the start of the text, and how many characters it takes: 0 if there is none.
 * Too large a number comes back as infinity. Always '.', whatever the locale. */
void linkdyn_parse_number(const char *text, int text_len, double *value, int *used);

/* The shortest decimals that are read back to the same number ("NaN", "inf", "-inf" if it is none); how
 * many characters were written: 24 at most. */
int linkdyn_format_number(double value, char *text, int text_len);

#ifdef __cplusplus
}
#endif
#endif
