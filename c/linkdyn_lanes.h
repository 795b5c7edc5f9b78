/* Kernels on lanes: instructions in compact form, and the machines that run them.
 *
 * A machine is one build of linkdyn_lanes_machine.c for an instruction set. It runs `lanes` samples side by side, or one
 * alone; what it computes does not depend on which, nor on the machine, as long as both have multiply-adds.
 */
#ifndef LINKDYN_LANES_H
#define LINKDYN_LANES_H

#include <stdint.h>

#include "linkdyn_emit.h"

/* Instructions: what they compute from x, b, c. The order is that of the tables in linkdyn_lanes_machine.c. */
enum {
    LANE_MULTIPLY,            /* x c */
    LANE_MULTIPLY_ADD,        /* x b + c */
    LANE_SUBTRACT_PRODUCT,    /* c - x b */
    LANE_MULTIPLY_SUBTRACT,   /* x b - c */
    LANE_ADD,                 /* x + c */
    LANE_SUBTRACT,            /* c - x */
    LANE_SUBTRACT_FROM,       /* x - c */
    LANE_RECIPROCAL,          /* 1/c */
    LANE_ROOT,                /* square root of c */
    LANE_ABSOLUTE,            /* |c| */
    LANE_WHOLE,               /* whole number nearest to c */
    LANE_MINIMUM,             /* x if x < c, else c */
    LANE_MAXIMUM,             /* x if x > c, else c */
    LANE_SELECT,              /* b if x > 0, else c */
    LANE_ARCTANGENT,          /* angle of (c, x) */
    LANE_SINE_COSINE,         /* sine of c to `out`, cosine to slot b */
    LANE_PIECE,               /* a component of a curve at place c, or a derivative of it */
    LANE_NEAREST,             /* the place of a curve nearest to the point (c, b) */
    LANE_FARTHEST,            /* the place of a curve farthest in the direction (c, b) */
    LANE_END,
    LANE_KINDS
};

/* An instruction's code is 8 kind + form. Form: sum of these. */
enum {
    FORM_ACCUMULATOR = 1,     /* c is the last result, still in registers */
    FORM_STORE = 2,           /* the result goes to slot `out` */
    FORM_CONSTANT = 4         /* x is a constant, the same for all lanes: `a` counts constants */
};

/* A kernel as a straight line: what a step computes from slots, which are counted from 0. What is not there is NO_SLOT. Slots
 * from `first_constant` on hold constants. */
enum { NO_SLOT = -1 };
struct lane_step {
    int kind, out;              /* LANE_*, the slot of the result */
    int second;                 /* of the cosine */
    int x, b, c;
    int table, which;           /* of look-ups: where the curve begins in the table, and what of it */
};
struct lane_line {
    int n_step;
    struct lane_step *step;
    int n_group;                /* outputs are taken in groups: of each the end among the outputs, and among the steps */
    int32_t *output_end;
    int *step_end;
    int32_t *output;            /* slots */
    int n_slot, first_constant, n_constant;    /* what look-ups read stands behind the constants */
};

struct instruction16 { uint16_t code, out, a, b, c; };
struct instruction32 { uint32_t code, out, a, b, c; };

struct lane_machine {
    const char *name;
    int lanes;
    int fuses;                /* has multiply-adds */
    void (*run16)(const struct instruction16 *step, double *slot, const double *constant);
    void (*run32)(const struct instruction32 *step, double *slot, const double *constant);
    void (*run_one16)(const struct instruction16 *step, double *slot, const double *constant);
    void (*run_one32)(const struct instruction32 *step, double *slot, const double *constant);
    struct lane_functions wide, one;          /* on a vector, on one number */
    /* rows of samples to slots: sample i of the source at source + i ld; lanes beyond count that share a vector with one of these
       repeat the last sample */
    void (*gather)(const double *source, long ld, int count, int n, double *slot);
    /* slots to rows of samples, with the sign of each; returns the lanes, one a bit, in which a number is not finite */
    uint64_t (*scatter)(const double *slot, const int32_t *which, const int32_t *sign, int n, double *target, long ld, int count);
    /* likewise to columns of samples: number k of the target at target + k ld */
    uint64_t (*scatter_columns)(const double *slot, const int32_t *which, const int32_t *sign, int n, double *target, long ld,
                                int count);
};

#endif
