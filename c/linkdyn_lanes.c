/* Kernels ready to run: as instructions for an interpreter, and as machine code where the processor and the system allow it. */
#include "linkdyn_lanes.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "linkdyn_code.h"
#include "linkdyn_code_choice.h"
#include "linkdyn_line.h"

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
    if (most >= 2 && linkdyn_best_set() == CODE_AVX512) best = &linkdyn_machine_avx512;
    else if (most >= 1 && linkdyn_best_set() >= CODE_AVX2) best = &linkdyn_machine_avx2;
#endif
    __atomic_store_n(&chosen, best, __ATOMIC_RELEASE);
    return best;
}

int linkdyn_machine_lanes(void) { return machine()->lanes; }
int linkdyn_machine_fuses(void) { return machine()->fuses; }
const char *linkdyn_machine_name(void) { return machine()->name; }

/* ---------------------------------------------------------------- packing */

struct packed {
    struct lane_line line;
    void *step;               /* instruction16 or instruction32, groups of them, each with an end */
    int *group;               /* where each group begins */
    int is_wide;
    double *constant;
    struct code *block, *one; /* machine code; NULL: none yet, or none at all */
    struct code *pair;        /* of blocks, two columns at once; NULL: there is nothing to be gained by it, either */
    char block_is_settled, one_is_settled;
};

static void put_instruction(struct packed *p, int n, struct instruction32 c)
{
    if (p->is_wide) ((struct instruction32 *)p->step)[n] = c;
    else ((struct instruction16 *)p->step)[n] = (struct instruction16){c.code, c.out, c.a, c.b, c.c};
}

/* The last result was for the next step alone: it need not be stored. */
static void keep_in_accumulator(struct packed *p, int n)
{
    if (p->is_wide) ((struct instruction32 *)p->step)[n].code -= FORM_STORE;
    else ((struct instruction16 *)p->step)[n].code -= FORM_STORE;
}

/* The instructions of the interpreter. `reads`: how often each result is read. */
static void pack_instructions(struct packed *p, const int *reads)
{
    const struct lane_line *line = &p->line;
    int n = 0, k = 0;
    for (int g = 0; g < line->n_group; g++) {
        int last = -1;                                /* the step whose result is in the accumulator */
        p->group[g] = n;
        for (; k < line->step_end[g]; k++) {
            const struct lane_step *s = &line->step[k];
            const int has_accumulator = last >= 0 && s->c == line->step[last].out && s->x != s->c && s->b != s->c;
            struct instruction32 c = {0, s->out, 0, 0, s->c};
            if (s->kind > LANE_SINE_COSINE) {
                c.code = s->kind*8;
                c.a = line->n_constant + s->table;
                c.b = s->kind == LANE_PIECE ? s->which : s->b;
                last = -1;
            } else if (s->kind == LANE_SINE_COSINE) {
                c.code = LANE_SINE_COSINE*8 + (has_accumulator ? FORM_ACCUMULATOR : 0);
                c.b = s->second;
                last = -1;
            } else {
                const int has_constant = linkdyn_is_constant(line, s->x);
                c.code = s->kind*8 + (has_accumulator ? FORM_ACCUMULATOR : 0) + (has_constant ? FORM_CONSTANT : 0) + FORM_STORE;
                c.a = has_constant ? s->x - line->first_constant : s->x == NO_SLOT ? 0 : s->x;
                c.b = s->b == NO_SLOT ? 0 : s->b;
                if (has_accumulator && reads[last] == 1) keep_in_accumulator(p, n - 1);
                last = k;
            }
            put_instruction(p, n++, c);
        }
        put_instruction(p, n++, (struct instruction32){.code = LANE_END*8});
    }
}

void linkdyn_unpack(struct packed *p)
{
    if (!p) return;
    linkdyn_free_code(p->block);
    linkdyn_free_code(p->one);
    linkdyn_free_code(p->pair);
    linkdyn_free_line(&p->line);
    free(p->constant);
    free(p->step);
    free(p->group);
    free(p);
}

/* Slots are counted from 0 here; an operand that is not there is -1. The table is what look-ups read. NULL: no memory. */
struct packed *linkdyn_pack(int n_step, const struct record_step *step, const int32_t *output, int n_group, const int32_t *output_end,
                            const int32_t *step_end, int n_slot, int first_constant, int n_constant, const double *constant,
                            int n_table, const double *table)
{
    struct packed *p = calloc(1, sizeof *p);
    if (!p) return NULL;
    p->line = (struct lane_line){.n_slot = n_slot, .first_constant = first_constant, .n_constant = n_constant};
    p->is_wide = n_slot > UINT16_MAX || n_constant + n_table > UINT16_MAX;
    p->constant = malloc(sizeof(double)*(n_constant + n_table + 1));
    p->group = malloc(sizeof(int)*(n_group + 1));
    p->step = calloc(n_step + n_group + 1, p->is_wide ? sizeof(struct instruction32) : sizeof(struct instruction16));
    int *reads = NULL;
    if (p->constant && p->step && p->group && linkdyn_make_line(n_step, step, output, n_group, output_end, step_end, &p->line))
        reads = linkdyn_count_reads(&p->line);
    if (!reads) {
        linkdyn_unpack(p);
        return NULL;
    }
    memcpy(p->constant, constant, sizeof(double)*n_constant);
    memcpy(p->constant + n_constant, table, sizeof(double)*n_table);
    pack_instructions(p, reads);
    free(reads);
    return p;
}

/* ---------------------------------------------------------------- slots */

static double *new_slots(const struct packed *p, long lanes)
{
    const size_t bytes = ((p->line.n_slot + 1)*lanes*sizeof(double) + 63)/64*64;
    double *slot = aligned_alloc(64, bytes);
    if (!slot) return NULL;
    memset(slot, 0, bytes);
    for (int k = 0; k < p->line.n_constant; k++)
        for (long l = 0; l < lanes; l++) slot[(p->line.first_constant + k)*lanes + l] = p->constant[k];
    return slot;
}

static void interpret(const struct packed *p, int one, int group, double *slot)
{
    const struct lane_machine *m = machine();
    const struct instruction32 *step32 = (struct instruction32 *)p->step + p->group[group];
    const struct instruction16 *step16 = (struct instruction16 *)p->step + p->group[group];
    if (p->is_wide) (one ? m->run_one32 : m->run32)(step32, slot, p->constant);
    else (one ? m->run_one16 : m->run16)(step16, slot, p->constant);
}

/* ---------------------------------------------------------------- machine code */

/* The same bits; what is no number may be so in many ways. */
static int is_same(double a, double b) { return memcmp(&a, &b, sizeof a) == 0 || (isnan(a) && isnan(b)); }

/* Numbers between -1 and 1, always the same. */
static double next_number(uint64_t *state)
{
    *state = *state*6364136223846793005u + 1442695040888963407u;
    return (double)(int64_t)*state*0x1p-63;
}

/* Does code give the interpreter's bits, on samples of some sizes? */
static int is_agreed(const struct packed *p, const struct code *code, int one)
{
    static const double size[] = {1.0, 0.1, 10.0};
    const int lanes = one ? 1 : machine()->lanes;
    double *slot = new_slots(p, lanes), *other = new_slots(p, lanes);
    int agreed = slot && other;
    uint64_t state = 1;
    for (int draw = 0; agreed && draw < (int)(sizeof size/sizeof size[0]); draw++) {
        for (long i = 0; i < p->line.first_constant*lanes; i++) slot[i] = other[i] = size[draw]*next_number(&state);
        for (int g = 0, k = 0; g < p->line.n_group; g++) {
            interpret(p, one, g, slot);
            linkdyn_run_code(code, g, other, p->constant, lanes);
            for (; k < p->line.output_end[g]; k++)
                for (long l = 0; l < lanes; l++)
                    agreed = agreed && is_same(slot[p->line.output[k]*lanes + l], other[p->line.output[k]*lanes + l]);
        }
    }
    free(slot);
    free(other);
    return agreed;
}

static const struct lane_functions *functions_of(enum code_set set)
{
#if defined(__x86_64__)
    return set == CODE_AVX512 ? &linkdyn_machine_avx512.wide : set == CODE_AVX2 ? &linkdyn_machine_avx2.wide : &linkdyn_machine_avx2.one;
#else
    (void)set;
    return &linkdyn_machine_baseline.one;
#endif
}

void linkdyn_tell_code(char *text, int room) { linkdyn_describe_code(machine()->fuses, text, room); }

/* Code of a kernel that gives the interpreter's bits. NULL: `reason` says why there is none. */
static struct code *agreed_code(const struct packed *p, enum code_set set, int one, int paired, char reason[EMIT_REASON])
{
    const int lanes = one ? 1 : machine()->lanes;
    struct code *code = (paired ? linkdyn_make_paired_code : linkdyn_make_code)(&p->line, set, lanes, functions_of(set), reason);
    if (!code || is_agreed(p, code, one)) return code;
    linkdyn_free_code(code);
    snprintf(reason, EMIT_REASON, "it differed from the interpreter");
    return NULL;
}

/* For whoever comes first: another thread may have been. */
static void publish(struct code **place, struct code *code)
{
    struct code *none = NULL;
    if (!__atomic_compare_exchange_n(place, &none, code, 0, __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE)) linkdyn_free_code(code);
}

/* Does the processor wait for results so long that a second column fills the gaps? It issues about a step a cycle; where the chain is
 * half as long as that the pair took 15 % less, where it is a fifth 5 % more. */
static int waits(const struct packed *p) { return 2*linkdyn_longest_chain(&p->line) > p->line.n_step; }

/* Machine code for blocks, or for one sample; made when it is first wanted. Where there is none, the interpreter runs. */
static void settle_code(struct packed *p, int one)
{
    char *is_settled = one ? &p->one_is_settled : &p->block_is_settled;
    if (__atomic_load_n(is_settled, __ATOMIC_ACQUIRE)) return;
    const enum code_set set = linkdyn_code_set(machine()->fuses, one);
    if (set != CODE_INTERPRETER) {
        char reason[EMIT_REASON];
        struct code *code = agreed_code(p, set, one, 0, reason);
        if (!code) linkdyn_code_refused(reason);
        if (code && !one && machine()->lanes >= 2*linkdyn_code_width(code) && waits(p)) {
            struct code *pair = agreed_code(p, set, 0, 1, reason);
            if (!pair) linkdyn_code_refused(reason);
            publish(&p->pair, pair);
        }
        publish(one ? &p->one : &p->block, code);
    }
    __atomic_store_n(is_settled, 1, __ATOMIC_RELEASE);
}

/* ---------------------------------------------------------------- running */

enum { LINE = 8 };            /* numbers of a line of the cache */

/* Room for a kernel's slots, constants in place; `one` for one sample alone. NULL: no memory. */
double *linkdyn_make_slots(struct packed *p, int one)
{
    settle_code(p, one);
    return new_slots(p, one ? 1 : machine()->lanes);
}

void linkdyn_free_slots(double *slot) { free(slot); }

static void run(const struct packed *p, int one, int group, double *slot, int count)
{
    const struct code *code = __atomic_load_n(one ? &p->one : &p->block, __ATOMIC_ACQUIRE);
    if (code && !one && count > linkdyn_code_width(code)) {
        const struct code *pair = __atomic_load_n(&p->pair, __ATOMIC_ACQUIRE);
        if (pair) code = pair;
    }
    if (code) linkdyn_run_code(code, group, slot, p->constant, count);
    else interpret(p, one, group, slot);
}

/* The steps of one group of outputs, for the first `count` lanes at least: a run has few. */
void linkdyn_run_lanes(const struct packed *p, int group, double *slot, int count) { run(p, 0, group, slot, count); }
void linkdyn_run_one(const struct packed *p, int group, double *slot) { run(p, 1, group, slot, 1); }

/* Samples, each n numbers, to the slots from `first` on. */
void linkdyn_gather(const double *source, long ld, int count, int n, double *slot, int first)
{
    if (n > 0) machine()->gather(source, ld, count, n, slot + (long)first*machine()->lanes);
}

/* Have the processor fetch the rows that results will be written to, while these are being computed. */
void linkdyn_expect(const double *target, long ld, int n, int count)
{
    const long last = n - 1;
    for (int i = 0; i < count; i++) {
        for (long k = 0; k < last; k += LINE) __builtin_prefetch(target + i*ld + k, 1);
        __builtin_prefetch(target + i*ld + last, 1);
    }
}

/* Slots, with their signs, to samples; returns the lanes, one a bit, in which a number is not finite. */
uint64_t linkdyn_scatter(const double *slot, const int32_t *which, const int32_t *sign, int n, double *target, long ld, int count)
{
    return n > 0 ? machine()->scatter(slot, which, sign, n, target, ld, count) : 0;
}

/* The same to columns. */
uint64_t linkdyn_scatter_columns(const double *slot, const int32_t *which, const int32_t *sign, int n, double *target, long ld,
                                 int count)
{
    return machine()->scatter_columns(slot, which, sign, n, target, ld, count);
}
