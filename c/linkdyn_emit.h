/* An encoder of machine code for straight lines of arithmetic on lanes. It knows instructions, not what they are for.
 *
 * One function a group of steps: it goes over the columns of a block (as many samples as a register holds), keeping
 * numbers in registers and slots. Errors are kept: linkdyn_emit_close tells the first.
 */
#ifndef LINKDYN_EMIT_H
#define LINKDYN_EMIT_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum code_set { CODE_INTERPRETER, CODE_SCALAR, CODE_AVX2, CODE_AVX512 };

/* Where an operand is. Only the last one of an instruction may be elsewhere than in a register. A constant is one number for
 * all lanes, which AVX2 cannot repeat by itself: it takes none. */
enum { IN_REGISTER, IN_SLOT, IN_CONSTANT };
struct place { int kind, index; };

enum emit_kind {
    EMIT_LOAD,                  /* d = z */
    EMIT_STORE,                 /* slot d = register y */
    EMIT_ADD, EMIT_SUBTRACT,    /* d = y + z, y - z */
    EMIT_MULTIPLY, EMIT_MINIMUM, EMIT_MAXIMUM,
    EMIT_RECIPROCAL,            /* d = 1/z; d is not the register of z */
    EMIT_ROOT, EMIT_ABSOLUTE, EMIT_WHOLE,
    EMIT_SELECT,                /* d = z where x > 0, else y; z in a register, as for the two before */
    /* multiply-adds, the result in the place of an operand as the processor has it:
       132: d = d z + y;  213: d = y d + z;  231: d = y z + d; with a minus before the addend, or before the product */
    EMIT_MULTIPLY_ADD_132, EMIT_MULTIPLY_ADD_213, EMIT_MULTIPLY_ADD_231,
    EMIT_MULTIPLY_SUBTRACT_132, EMIT_MULTIPLY_SUBTRACT_213, EMIT_MULTIPLY_SUBTRACT_231,
    EMIT_SUBTRACT_PRODUCT_132, EMIT_SUBTRACT_PRODUCT_213, EMIT_SUBTRACT_PRODUCT_231,
    EMIT_SINE_COSINE,           /* slots d, y = sine and cosine of slot z: a call, all registers are lost */
    EMIT_ARCTANGENT,            /* slot d = angle of (x: slot z, y: slot y): a call */
    EMIT_PIECE,                 /* slot d = what `which` says of the table behind constant `table` at slot z: a call */
    EMIT_PLACE                  /* slot d = the place found there for slots z, y; `which`: the farthest one: a call */
};

struct emit_step {
    int16_t kind;
    int16_t x;                  /* a register */
    int32_t d, y;               /* registers, or slots */
    struct place z;
    int32_t table, which;
};

/* What code calls for the functions that are no instructions; pointers to one column. */
struct lane_functions {
    void (*sine_cosine)(const double *x, double *sine, double *cosine);
    void (*arctangent)(const double *y, const double *x, double *angle);
    void (*piece)(const double *place, double *out, const double *table, long which);
    void (*place)(const double *a, const double *b, double *out, const double *table, long is_farthest);
};

/* Runs one group on columns of slots. */
typedef void (*code_function)(double *slot, const double *constant, long columns);

struct emitter;

/* Is there an encoder for this processor in this build? */
int linkdyn_emit_is_there(void);
/* Samples that a register holds. */
int linkdyn_emit_width(enum code_set set);
/* Registers of the set on this processor that may hold numbers. */
int linkdyn_emit_registers(enum code_set set);
/* Room for `n_step` steps in `n_function` functions on slots of `lanes` numbers, of which `columns` columns are taken at once: with
 * two of them slot 2 s + 1 of the steps is the second column of slot s. NULL: no memory. */
struct emitter *linkdyn_emit_open(enum code_set set, int lanes, int columns, size_t n_step, size_t n_function, const struct lane_functions *functions);
/* The offset of a new function. */
size_t linkdyn_emit_begin(struct emitter *e);
void linkdyn_emit_step(struct emitter *e, const struct emit_step *step);
void linkdyn_emit_end(struct emitter *e);
/* Make the functions executable. NULL: `reason` says why not. */
enum { EMIT_REASON = 80 };
const char *linkdyn_emit_close(struct emitter *e, char reason[EMIT_REASON]);
void linkdyn_emit_free(struct emitter *e);

#ifdef __cplusplus
}
#endif
#endif
