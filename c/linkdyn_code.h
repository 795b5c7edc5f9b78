/* Machine code of a kernel: a straight line of steps, its numbers in registers as long as these last. */
#ifndef LINKDYN_CODE_H
#define LINKDYN_CODE_H

#include "linkdyn_emit.h"
#include "linkdyn_lanes.h"

struct code;

/* Emit the groups of a line for slots of `lanes` numbers. NULL: `reason` says why not. */
struct code *linkdyn_make_code(const struct lane_line *line, enum code_set set, int lanes, const struct lane_functions *functions,
                               char reason[EMIT_REASON]);
/* The same that goes over two columns at once: as many chains of steps for the processor, of which none waits for the other. */
struct code *linkdyn_make_paired_code(const struct lane_line *line, enum code_set set, int lanes,
                                      const struct lane_functions *functions, char reason[EMIT_REASON]);
/* Samples that it computes at once. */
int linkdyn_code_width(const struct code *code);
void linkdyn_free_code(struct code *code);

/* Run one group: the columns that the first `count` lanes of the slots stand in. */
void linkdyn_run_code(const struct code *code, int group, double *slot, const double *constant, int count);

#endif
