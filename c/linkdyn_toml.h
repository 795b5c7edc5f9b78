/* A small C view of a parsed TOML document, for Fortran's bind(c).
 *
 * Nodes are opaque and live as long as their document. Strings travel as (pointer, length), never
 * NUL-terminated; copies are cut at the caller's length and the full length is returned. No C++
 * exception leaves these functions. */
#ifndef LINKDYN_TOML_H
#define LINKDYN_TOML_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum linkdyn_toml_kind {
    linkdyn_toml_absent = 0,
    linkdyn_toml_string = 1,
    linkdyn_toml_integer = 2,
    linkdyn_toml_float = 3,
    linkdyn_toml_boolean = 4,
    linkdyn_toml_table = 5,
    linkdyn_toml_array = 6,
    linkdyn_toml_date = 7
};

/* The document, or NULL with a message (without position) and the place of the error. `before` is what lines of nodes
 * count on from: 0, or the number of lines of all files before. */
void *linkdyn_toml_parse(const char *text, int64_t text_len, int before, char *message, int message_len,
                         int *line, int *column);
void linkdyn_toml_free(void *document);
const void *linkdyn_toml_root(const void *document);

/* All of these accept NULL as the node that is not there. Indices count from 0. */
int linkdyn_toml_kind_of(const void *node);
int linkdyn_toml_line(const void *node);
int64_t linkdyn_toml_size(const void *node);                        /* of a table or an array */
const void *linkdyn_toml_at(const void *array, int64_t index);
const void *linkdyn_toml_get(const void *table, const char *key, int key_len);
int linkdyn_toml_key(const void *table, int64_t index, char *key, int key_len, int *line);

/* 1 if the node has that type (a float may be written as an integer), else 0. */
int linkdyn_toml_double(const void *node, double *value);
int linkdyn_toml_int64(const void *node, int64_t *value);
int linkdyn_toml_bool(const void *node, int *value);
/* Length of the string, -1 if the node is none. */
int64_t linkdyn_toml_text(const void *node, char *text, int64_t text_len);

/* Another number or text in place of a value that is there; 1 if it was. Its line is lost. */
int linkdyn_toml_put(const void *table, const char *key, int key_len, double value);
int linkdyn_toml_put_text(const void *table, const char *key, int key_len, const char *text, int64_t text_len);
int linkdyn_toml_put_at(const void *array, int64_t index, double value);
int linkdyn_toml_put_text_at(const void *array, int64_t index, const char *text, int64_t text_len);

/* Documents of several files: one key less; names of files (`table`, `mesh`) with a folder in front; all of another document
 * moved into this one, 1 if nothing is there twice, else 0 with the key and both lines; the document as a text (free with
 * linkdyn_file_free). */
void linkdyn_toml_take_out(void *document, const char *key, int key_len);
int linkdyn_toml_move_files(void *document, const char *folder, int folder_len);
int linkdyn_toml_join(void *document, void *other, char *key, int key_len, int *first_line, int *second_line);
int linkdyn_toml_write(const void *document, char **text, int64_t *text_len);

#ifdef __cplusplus
}
#endif
#endif
