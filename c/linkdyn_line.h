/* From the steps of a schedule to a straight line of what lanes can do. */
#ifndef LINKDYN_LINE_H
#define LINKDYN_LINE_H

#include "linkdyn_lanes.h"

/* A step as the schedule numbers them: an operation of records, or one that joins two; slots are counted from 0, an operand
 * that is not there is negative. Of a look-up: where its curve begins in the table, and what of it. */
struct record_step { int32_t kind, result, operand[3], table, which; };

/* Is the result of a step in registers when the next one begins? Not if a function has made it. */
static inline int leaves_accumulator(int kind) { return kind < LANE_SINE_COSINE; }

/* Two slots change places. */
static inline void swap_slots(int *a, int *b)
{
    const int t = *a;
    *a = *b;
    *b = t;
}

int linkdyn_is_constant(const struct lane_line *line, int slot);
/* Fill in steps, groups and outputs; the numbers of slots and constants are there. 0: no memory. */
int linkdyn_make_line(int n_step, const struct record_step *step, const int32_t *output, int n_group, const int32_t *output_end,
                      const int32_t *step_end, struct lane_line *line);
/* About how many cycles the longest chain of steps takes, each of which waits for the one before; no memory: 0. */
long linkdyn_longest_chain(const struct lane_line *line);
/* The same line for two columns side by side, step by step in turns: slots 2 s and 2 s + 1 are slot s of each; constants serve both.
 * 0: no memory. */
int linkdyn_pair_line(const struct lane_line *line, struct lane_line *pair);
void linkdyn_free_line(struct lane_line *line);
/* How often the result of each step is read before its slot is written again. NULL: no memory. */
int *linkdyn_count_reads(const struct lane_line *line);

#endif
