/* Kernels in compact form: packing, and the choice of the machine that runs them. */
#include "linkdyn_lanes.h"

#include <stdlib.h>
#include <string.h>

extern const struct lane_machine linkdyn_machine_baseline;
#if defined(__x86_64__)
extern const struct lane_machine linkdyn_machine_avx2, linkdyn_machine_avx512;
#endif

/* What this processor runs fastest. LINKDYN_MACHINE = avx512 | avx2 | baseline asks for less. */
static const struct lane_machine *machine(void)
{
    static const struct lane_machine *chosen;
    const struct lane_machine *best = __atomic_load_n(&chosen, __ATOMIC_ACQUIRE);
    if (best) return best;
    best = &linkdyn_machine_baseline;
#if defined(__x86_64__)
    const char *wish = getenv("LINKDYN_MACHINE");
    int most = !wish ? 2 : strcmp(wish, "baseline") == 0 ? 0 : strcmp(wish, "avx2") == 0 ? 1 : 2;
    __builtin_cpu_init();
    if (most >= 2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
        best = &linkdyn_machine_avx512;
    else if (most >= 1 && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
        best = &linkdyn_machine_avx2;
#endif
    __atomic_store_n(&chosen, best, __ATOMIC_RELEASE);
    return best;
}

int linkdyn_machine_lanes(void) { return machine()->lanes; }
int linkdyn_machine_fuses(void) { return machine()->fuses; }
const char *linkdyn_machine_name(void) { return machine()->name; }

/* ---------------------------------------------------------------- packing */

struct packed {
    void *step;               /* instruction16 or instruction32, groups of them, each with an end */
    int *group;               /* where each group begins */
    int is_wide;
    int n_slot, n_constant, first_constant;
    double *constant;
};

/* Instructions as the schedule numbers them: the operations of a record, then those that join two. */
enum { OP_ADD = 4, OP_SUBTRACT, OP_MULTIPLY, OP_RECIPROCAL, OP_ROOT, OP_SINE, OP_COSINE, OP_ARCTANGENT, OP_MINIMUM, OP_MAXIMUM,
       OP_ABSOLUTE, OP_SELECT, OP_WHOLE, OP_MULTIPLY_ADD, OP_MULTIPLY_SUBTRACT, OP_SUBTRACT_PRODUCT };

struct step { int32_t kind, result, operand[3]; };

static int is_constant(const struct packed *p, int slot)
{
    return slot >= p->first_constant && slot < p->first_constant + p->n_constant;
}

/* The operands x, b, c of a lane instruction; of two that may change places, a constant becomes x and the last result c. */
struct lane_step { int kind, x, b, c; };
enum { NO_SLOT = -1 };

static void swap(int *a, int *b)
{
    const int t = *a;
    *a = *b;
    *b = t;
}

static struct lane_step lane_step_of(const struct packed *p, const struct step *s, int last)
{
    const int *o = s->operand;
    switch (s->kind) {
    case OP_MULTIPLY_ADD: case OP_MULTIPLY_SUBTRACT: case OP_SUBTRACT_PRODUCT: {
        struct lane_step r = {s->kind == OP_MULTIPLY_ADD ? LANE_MULTIPLY_ADD : s->kind == OP_MULTIPLY_SUBTRACT
                              ? LANE_MULTIPLY_SUBTRACT : LANE_SUBTRACT_PRODUCT, o[0], o[1], o[2]};
        if (is_constant(p, r.b)) swap(&r.x, &r.b);
        return r;
    }
    case OP_ADD: case OP_MULTIPLY: {
        struct lane_step r = {s->kind == OP_ADD ? LANE_ADD : LANE_MULTIPLY, o[0], 0, o[1]};
        if (r.x == last || is_constant(p, r.c)) swap(&r.x, &r.c);
        if (is_constant(p, r.c) && !is_constant(p, r.x)) swap(&r.x, &r.c);
        return r;
    }
    case OP_SUBTRACT: {
        /* o[0] - o[1] */
        if (o[1] == last || (o[0] != last && is_constant(p, o[0]))) return (struct lane_step){LANE_SUBTRACT_FROM, o[0], 0, o[1]};
        return (struct lane_step){LANE_SUBTRACT, o[1], 0, o[0]};
    }
    case OP_MINIMUM: return (struct lane_step){LANE_MINIMUM, o[0], 0, o[1]};
    case OP_MAXIMUM: return (struct lane_step){LANE_MAXIMUM, o[0], 0, o[1]};
    case OP_ARCTANGENT: return (struct lane_step){LANE_ARCTANGENT, o[0], 0, o[1]};
    case OP_SELECT: return (struct lane_step){LANE_SELECT, o[0], o[1], o[2]};
    case OP_RECIPROCAL: return (struct lane_step){LANE_RECIPROCAL, NO_SLOT, 0, o[0]};
    case OP_ROOT: return (struct lane_step){LANE_ROOT, NO_SLOT, 0, o[0]};
    case OP_ABSOLUTE: return (struct lane_step){LANE_ABSOLUTE, NO_SLOT, 0, o[0]};
    case OP_WHOLE: return (struct lane_step){LANE_WHOLE, NO_SLOT, 0, o[0]};
    default: return (struct lane_step){LANE_SINE_COSINE, NO_SLOT, 0, o[0]};
    }
}

/* Groups of outputs: the outputs up to `output_end` are taken after the steps up to `step_end`. */
struct groups { int n; const int32_t *output_end, *step_end; };

/* How often each result is read before its slot is written again. */
static int *count_reads(const struct step *step, int n_step, const int32_t *output, const struct groups *groups, int n_slot)
{
    int *reads = calloc(n_step + 1, sizeof *reads), *writer = calloc(n_slot, sizeof *writer);
    if (!reads || !writer) {
        free(reads);
        free(writer);
        return NULL;
    }
    for (int k = 0; k < n_slot; k++) writer[k] = n_step;
    int g = 0, taken = 0;
    for (int k = 0; k <= n_step; k++) {
        for (; g < groups->n && groups->step_end[g] <= k; g++)
            for (; taken < groups->output_end[g]; taken++) reads[writer[output[taken]]] += 2;
        if (k == n_step) break;
        for (int i = 0; i < 3; i++)
            if (step[k].operand[i] >= 0) reads[writer[step[k].operand[i]]]++;
        writer[step[k].result] = k;
    }
    free(writer);
    return reads;
}

/* Slots are counted from 0 here; an operand that is not there is -1. NULL: no memory. */
struct packed *linkdyn_pack(int n_step, const struct step *step, const int32_t *output, int n_group, const int32_t *output_end,
                            const int32_t *step_end, int n_slot, int first_constant, int n_constant, const double *constant)
{
    const struct groups groups = {n_group, output_end, step_end};
    struct packed *p = calloc(1, sizeof *p);
    if (!p) return NULL;
    p->n_slot = n_slot;
    p->first_constant = first_constant;
    p->n_constant = n_constant;
    p->is_wide = n_slot > UINT16_MAX || n_constant > UINT16_MAX;
    p->constant = malloc(sizeof(double)*(n_constant + 1));
    p->group = malloc(sizeof(int)*(n_group + 1));
    p->step = calloc(n_step + n_group + 1, p->is_wide ? sizeof(struct instruction32) : sizeof(struct instruction16));
    int *reads = count_reads(step, n_step, output, &groups, n_slot);
    if (!p->constant || !p->step || !p->group || !reads) {
        free(p->constant);
        free(p->step);
        free(p->group);
        free(reads);
        free(p);
        return NULL;
    }
    memcpy(p->constant, constant, sizeof(double)*n_constant);

    int n = 0, last = -1, last_index = -1;    /* slot and index of the step whose result is in the accumulator */
    int g = 0;
    p->group[0] = 0;
    for (int k = 0; k <= n_step; k++) {
        for (; g < n_group && step_end[g] <= k; g++) {
            if (p->is_wide) ((struct instruction32 *)p->step)[n++].code = LANE_END*8;
            else ((struct instruction16 *)p->step)[n++].code = LANE_END*8;
            p->group[g + 1] = n;
            last = last_index = -1;
        }
        if (k == n_step) break;
        struct instruction32 c = {0};
        const struct lane_step s = lane_step_of(p, &step[k], last);
        if (s.kind == LANE_SINE_COSINE) {
            /* the schedule puts sine and cosine of one angle side by side, the sine first */
            const int has_accumulator = s.c == last;
            int sine = step[k].result, cosine = n_slot;          /* slot n_slot is for what nobody wants */
            if (step[k].kind == OP_COSINE) {
                cosine = sine;
                sine = n_slot;
            } else if (k + 1 < n_step && (g >= n_group || step_end[g] > k + 1) && step[k + 1].kind == OP_COSINE && step[k + 1].operand[0] == step[k].operand[0]) {
                cosine = step[++k].result;
            }
            c = (struct instruction32){LANE_SINE_COSINE*8 + (has_accumulator ? FORM_ACCUMULATOR : 0), sine, 0, cosine, s.c};
            last = last_index = -1;
        } else {
            const int has_constant = is_constant(p, s.x);
            const int has_accumulator = last >= 0 && s.c == last && s.x != last && s.b != last;
            c.code = s.kind*8 + (has_accumulator ? FORM_ACCUMULATOR : 0) + (has_constant ? FORM_CONSTANT : 0) + FORM_STORE;
            c.out = step[k].result;
            c.a = has_constant ? s.x - first_constant : s.x < 0 ? 0 : s.x;
            c.b = s.b < 0 ? 0 : s.b;
            c.c = s.c;
            /* the last result was for this step alone: it need not be stored */
            if (has_accumulator && reads[last_index] == 1) {
                if (p->is_wide) ((struct instruction32 *)p->step)[n - 1].code -= FORM_STORE;
                else ((struct instruction16 *)p->step)[n - 1].code -= FORM_STORE;
            }
            last = step[k].result;
            last_index = k;
        }
        if (p->is_wide) ((struct instruction32 *)p->step)[n++] = c;
        else ((struct instruction16 *)p->step)[n++] = (struct instruction16){c.code, c.out, c.a, c.b, c.c};
    }
    free(reads);
    return p;
}

void linkdyn_unpack(struct packed *p)
{
    if (!p) return;
    free(p->constant);
    free(p->step);
    free(p->group);
    free(p);
}

/* ---------------------------------------------------------------- slots */

/* Room for a kernel's slots, constants in place; `one` for one sample alone. NULL: no memory. */
double *linkdyn_make_slots(const struct packed *p, int one)
{
    const long lanes = one ? 1 : machine()->lanes;
    const size_t bytes = ((p->n_slot + 1)*lanes*sizeof(double) + 63)/64*64;
    double *slot = aligned_alloc(64, bytes);
    if (!slot) return NULL;
    memset(slot, 0, bytes);
    for (int k = 0; k < p->n_constant; k++)
        for (long l = 0; l < lanes; l++) slot[(p->first_constant + k)*lanes + l] = p->constant[k];
    return slot;
}

void linkdyn_free_slots(double *slot) { free(slot); }

/* ---------------------------------------------------------------- running */

/* The instructions of one group of outputs. */
void linkdyn_run_lanes(const struct packed *p, int group, double *slot)
{
    if (p->is_wide) machine()->run32((struct instruction32 *)p->step + p->group[group], slot, p->constant);
    else machine()->run16((struct instruction16 *)p->step + p->group[group], slot, p->constant);
}

void linkdyn_run_one(const struct packed *p, int group, double *slot)
{
    if (p->is_wide) machine()->run_one32((struct instruction32 *)p->step + p->group[group], slot, p->constant);
    else machine()->run_one16((struct instruction16 *)p->step + p->group[group], slot, p->constant);
}

/* Samples, each n numbers, to the slots from `first` on. */
void linkdyn_gather(const double *source, long ld, int count, int n, double *slot, int first)
{
    if (n > 0) machine()->gather(source, ld, count, n, slot + (long)first*machine()->lanes);
}

/* Slots, with their signs, to samples; returns the lanes, one a bit, in which a number is not finite. */
uint64_t linkdyn_scatter(const double *slot, const int32_t *which, const int32_t *sign, int n, double *target, long ld, int count)
{
    return n > 0 ? machine()->scatter(slot, which, sign, n, target, ld, count) : 0;
}
