/* Registers on a straight line: what is needed last gives way (Belady 1966). Every value has a slot of its own while it is
 * needed, as the schedule has placed it; it is written there only when its register is wanted, or when a later group or
 * whoever takes the outputs reads it.
 */
#include "linkdyn_code.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>

#include "linkdyn_line.h"

enum { NEVER = INT_MAX, MOST_REGISTERS = 32, NO_REGISTER = -1 };

struct code {
    struct emitter *emitter;
    int width;                  /* samples of the columns that stand side by side */
    code_function entry[];      /* (group) */
};

/* ---------------------------------------------------------------- when values are needed */

/* Of each step: when its operands x, b, c are read next in the same group, when its results are read first there, and whether
 * they must be in their slots when the group is done. */
struct needs {
    int next[3];
    int first[2];
    char is_kept[2];
};

static void operands_of(const struct lane_step *s, int operand[3])
{
    operand[0] = s->x;
    operand[1] = s->b;
    operand[2] = s->c;
}

static void results_of(const struct lane_step *s, int result[2])
{
    result[0] = s->out;
    result[1] = s->second;
}

/* What is known of the slots on the walk back: when each is read next, and when last before it is written. */
struct walk { int *next, *last; };

static void note_read(const struct walk *w, int slot, int when)
{
    w->next[slot] = when;
    if (w->last[slot] < when) w->last[slot] = when;
}

static void note_step(const struct walk *w, const struct lane_step *step, int k, int end, struct needs *needs)
{
    int operand[3], result[2];
    operands_of(step, operand);
    results_of(step, result);
    for (int i = 0; i < 2; i++) {
        if (result[i] < 0) continue;
        needs->first[i] = w->next[result[i]] < end ? w->next[result[i]] : NEVER;
        needs->is_kept[i] = w->last[result[i]] >= end;
        w->next[result[i]] = NEVER;
        w->last[result[i]] = -1;
    }
    for (int i = 0; i < 3; i++)
        if (operand[i] >= 0) needs->next[i] = w->next[operand[i]] < end ? w->next[operand[i]] : NEVER;
    for (int i = 0; i < 3; i++)
        if (operand[i] >= 0) note_read(w, operand[i], k);
}

/* One walk back over all groups; outputs are read at the end of theirs. NULL: no memory. */
static struct needs *find_needs(const struct lane_line *line)
{
    struct needs *needs = malloc(sizeof *needs*(line->n_step + 1));
    const struct walk w = {malloc(sizeof *w.next*(line->n_slot + 1)), malloc(sizeof *w.last*(line->n_slot + 1))};
    if (needs && w.next && w.last) {
        for (int s = 0; s <= line->n_slot; s++) {
            w.next[s] = NEVER;
            w.last[s] = -1;
        }
        for (int g = line->n_group - 1; g >= 0; g--) {
            const int end = line->step_end[g], begin = g > 0 ? line->step_end[g - 1] : 0;
            for (int i = g > 0 ? line->output_end[g - 1] : 0; i < line->output_end[g]; i++) note_read(&w, line->output[i], end);
            for (int k = end - 1; k >= begin; k--) note_step(&w, &line->step[k], k, end, &needs[k]);
        }
    } else {
        free(needs);
        needs = NULL;
    }
    free(w.next);
    free(w.last);
    return needs;
}

/* ---------------------------------------------------------------- registers */

struct allocation {
    const struct lane_line *line;
    int columns;                /* that stand side by side: slots of the line are counted for each */
    int n_register;
    int repeats;                /* can one number be taken for all lanes? Else constants are read from their slots */
    int held[MOST_REGISTERS];   /* the slot whose value a register holds; -1: it is free */
    int *home;                  /* (slot) the register that holds its value */
    int *next;                  /* (slot) when it is read next in this group */
    char *is_stored;            /* (slot) is its value there? */
    uint32_t pinned;            /* registers that this step needs */
    struct emit_step *step;     /* what has been made */
    size_t n_step, room;
    int is_short;               /* of memory */
};

static void put(struct allocation *a, struct emit_step step)
{
    if (a->n_step == a->room) {
        const size_t room = 2*a->room + 1024;
        struct emit_step *more = realloc(a->step, sizeof *more*room);
        if (!more) {
            a->is_short = 1;
            return;
        }
        a->step = more;
        a->room = room;
    }
    a->step[a->n_step++] = step;
}

static struct place memory_of(const struct allocation *a, int slot)
{
    if (a->repeats && linkdyn_is_constant(a->line, slot)) return (struct place){IN_CONSTANT, (slot - a->line->first_constant)/a->columns};
    return (struct place){IN_SLOT, slot};
}

static void store(struct allocation *a, int slot)
{
    if (a->is_stored[slot]) return;
    put(a, (struct emit_step){.kind = EMIT_STORE, .d = slot, .y = a->home[slot]});
    a->is_stored[slot] = 1;
}

static void release(struct allocation *a, int slot)
{
    if (a->home[slot] == NO_REGISTER) return;
    a->held[a->home[slot]] = -1;
    a->home[slot] = NO_REGISTER;
}

/* The register whose number is needed last, none of this step's. */
static int last_needed(const struct allocation *a)
{
    int best = NO_REGISTER;
    for (int r = 0; r < a->n_register; r++) {
        if (a->pinned >> r & 1) continue;
        if (a->held[r] < 0) return r;
        if (best == NO_REGISTER || a->next[a->held[r]] > a->next[a->held[best]]) best = r;
    }
    return best;
}

static int take_register(struct allocation *a)
{
    const int r = last_needed(a);
    if (a->held[r] >= 0) {
        store(a, a->held[r]);
        release(a, a->held[r]);
    }
    a->pinned |= (uint32_t)1 << r;
    return r;
}

/* The register of an operand. */
static int in_register(struct allocation *a, int slot)
{
    if (a->home[slot] == NO_REGISTER) {
        const int r = take_register(a);
        put(a, (struct emit_step){.kind = EMIT_LOAD, .d = r, .z = memory_of(a, slot)});
        a->held[r] = slot;
        a->home[slot] = r;
    }
    return a->home[slot];
}

/* An operand where it is; into a register, if it is needed again before what would give way. */
static struct place anywhere(struct allocation *a, int slot)
{
    if (a->home[slot] == NO_REGISTER) {
        const int r = a->next[slot] == NEVER ? NO_REGISTER : last_needed(a);
        if (r == NO_REGISTER || (a->held[r] >= 0 && a->next[a->held[r]] <= a->next[slot])) return memory_of(a, slot);
    }
    return (struct place){IN_REGISTER, in_register(a, slot)};
}

static int is_over(const struct allocation *a, int slot) { return a->next[slot] == NEVER; }

/* Operands that are not read again leave their registers. */
static void release_operands(struct allocation *a, const int operand[3])
{
    for (int i = 0; i < 3; i++) {
        if (operand[i] < 0 || a->home[operand[i]] == NO_REGISTER || !is_over(a, operand[i])) continue;
        a->pinned &= ~((uint32_t)1 << a->home[operand[i]]);
        release(a, operand[i]);
    }
}

/* ---------------------------------------------------------------- steps */

/* d = p q + c in one of the three forms that the processor has; `kind` is the first of them. */
static int put_multiply_add(struct allocation *a, int kind, int p, int q, int c)
{
    int d;
    if (a->home[p] == NO_REGISTER || (a->home[q] != NO_REGISTER && is_over(a, q) && !is_over(a, p))) swap_slots(&p, &q);
    if (a->home[c] != NO_REGISTER && is_over(a, c)) {                  /* 231: d = p q + d */
        d = a->home[c];
    } else if (a->home[p] != NO_REGISTER && is_over(a, p)) {
        d = a->home[p];
        if (a->home[q] == NO_REGISTER && a->home[c] != NO_REGISTER) {  /* 132: d = d q + c */
            const struct place z = anywhere(a, q);
            put(a, (struct emit_step){.kind = kind, .d = d, .y = a->home[c], .z = z});
        } else {                                                       /* 213: d = q d + c */
            const int y = in_register(a, q);
            const struct place z = anywhere(a, c);
            put(a, (struct emit_step){.kind = kind + 1, .d = d, .y = y, .z = z});
        }
        return d;
    } else {
        d = take_register(a);
        put(a, (struct emit_step){.kind = EMIT_LOAD, .d = d,
            .z = a->home[c] != NO_REGISTER ? (struct place){IN_REGISTER, a->home[c]} : memory_of(a, c)});
    }
    const int y = in_register(a, p);
    const struct place z = anywhere(a, q);
    put(a, (struct emit_step){.kind = kind + 2, .d = d, .y = y, .z = z});
    return d;
}

/* d = y (kind) z, or of z alone. */
static int put_plain(struct allocation *a, const struct lane_step *s, const int operand[3])
{
    struct emit_step step = {0};
    int y = s->x, z = s->c, d = NO_REGISTER;
    switch (s->kind) {
    case LANE_MULTIPLY: step.kind = EMIT_MULTIPLY; break;
    case LANE_ADD: step.kind = EMIT_ADD; break;
    case LANE_SUBTRACT: step.kind = EMIT_SUBTRACT; y = s->c; z = s->x; break;
    case LANE_SUBTRACT_FROM: step.kind = EMIT_SUBTRACT; break;
    case LANE_MINIMUM: step.kind = EMIT_MINIMUM; break;
    case LANE_MAXIMUM: step.kind = EMIT_MAXIMUM; break;
    case LANE_RECIPROCAL: step.kind = EMIT_RECIPROCAL; break;
    case LANE_ROOT: step.kind = EMIT_ROOT; break;
    case LANE_ABSOLUTE: step.kind = EMIT_ABSOLUTE; break;
    case LANE_WHOLE: step.kind = EMIT_WHOLE; break;
    default: step.kind = EMIT_SELECT; y = s->c; z = s->b; step.x = in_register(a, s->x); break;
    }
    if ((s->kind == LANE_MULTIPLY || s->kind == LANE_ADD) && a->home[y] == NO_REGISTER) swap_slots(&y, &z);
    if (y >= 0) step.y = in_register(a, y);
    /* these have no form with a number in memory for every set */
    const int wants_register = s->kind == LANE_ABSOLUTE || s->kind == LANE_WHOLE || s->kind == LANE_SELECT;
    step.z = wants_register ? (struct place){IN_REGISTER, in_register(a, z)} : anywhere(a, z);
    if (s->kind == LANE_RECIPROCAL) d = take_register(a);              /* another than that of z */
    release_operands(a, operand);
    step.d = d == NO_REGISTER ? take_register(a) : d;
    put(a, step);
    return step.d;
}

/* A call: numbers that are needed later go to their slots, results come in theirs. */
static void put_call(struct allocation *a, const struct lane_step *s, const int operand[3], const struct needs *needs)
{
    for (int r = 0; r < a->n_register; r++) {
        const int slot = a->held[r];
        if (slot < 0) continue;
        const int is_operand = slot == operand[0] || slot == operand[1] || slot == operand[2];
        if (is_operand || !is_over(a, slot)) store(a, slot);
        release(a, slot);
    }
    if (s->kind == LANE_PIECE)
        put(a, (struct emit_step){.kind = EMIT_PIECE, .d = s->out, .z = {IN_SLOT, s->c}, .table = a->line->n_constant/a->columns + s->table,
            .which = s->which});
    else if (s->kind == LANE_NEAREST || s->kind == LANE_FARTHEST)
        put(a, (struct emit_step){.kind = EMIT_PLACE, .d = s->out, .y = s->b, .z = {IN_SLOT, s->c},
            .table = a->line->n_constant/a->columns + s->table, .which = s->kind == LANE_FARTHEST});
    else if (s->kind == LANE_ARCTANGENT)
        put(a, (struct emit_step){.kind = EMIT_ARCTANGENT, .d = s->out, .y = s->x, .z = {IN_SLOT, s->c}});
    else
        put(a, (struct emit_step){.kind = EMIT_SINE_COSINE, .d = s->out, .y = s->second, .z = {IN_SLOT, s->c}});
    int result[2];
    results_of(s, result);
    for (int i = 0; i < 2; i++) {
        if (result[i] < 0) continue;
        a->next[result[i]] = needs->first[i];
        a->is_stored[result[i]] = 1;
    }
}

static void put_step(struct allocation *a, const struct lane_step *s, const struct needs *needs)
{
    int operand[3], d;
    operands_of(s, operand);
    a->pinned = 0;
    for (int i = 0; i < 3; i++) {
        if (operand[i] < 0) continue;
        a->next[operand[i]] = needs->next[i];
        if (a->home[operand[i]] != NO_REGISTER) a->pinned |= (uint32_t)1 << a->home[operand[i]];
    }
    switch (s->kind) {
    case LANE_SINE_COSINE: case LANE_ARCTANGENT: case LANE_PIECE: case LANE_NEAREST: case LANE_FARTHEST:
        put_call(a, s, operand, needs);
        return;
    case LANE_MULTIPLY_ADD: d = put_multiply_add(a, EMIT_MULTIPLY_ADD_132, s->x, s->b, s->c); break;
    case LANE_MULTIPLY_SUBTRACT: d = put_multiply_add(a, EMIT_MULTIPLY_SUBTRACT_132, s->x, s->b, s->c); break;
    case LANE_SUBTRACT_PRODUCT: d = put_multiply_add(a, EMIT_SUBTRACT_PRODUCT_132, s->x, s->b, s->c); break;
    default: d = put_plain(a, s, operand); break;
    }
    release_operands(a, operand);
    a->held[d] = s->out;
    a->home[s->out] = d;
    a->next[s->out] = needs->first[0];
    a->is_stored[s->out] = 0;
    if (needs->is_kept[0]) store(a, s->out);
    if (is_over(a, s->out)) release(a, s->out);
}

/* ---------------------------------------------------------------- a kernel */

/* The steps of all groups for the encoder; `end` says where each group's end. */
static int allocate(struct allocation *a, const struct needs *needs, size_t *end)
{
    const struct lane_line *line = a->line;
    for (int s = 0; s <= line->n_slot; s++) {
        a->home[s] = NO_REGISTER;
        a->next[s] = NEVER;
        a->is_stored[s] = 1;
    }
    int k = 0;
    for (int g = 0; g < line->n_group; g++) {
        for (int r = 0; r < a->n_register; r++) {
            if (a->held[r] >= 0) release(a, a->held[r]);
        }
        for (; k < line->step_end[g]; k++) put_step(a, &line->step[k], &needs[k]);
        end[g] = a->n_step;
    }
    return !a->is_short;
}

static struct code *encode(const struct allocation *a, const size_t *end, enum code_set set, int lanes,
                           const struct lane_functions *functions, char reason[EMIT_REASON])
{
    const int n_group = a->line->n_group;
    struct code *code = calloc(1, sizeof *code + n_group*sizeof code->entry[0]);
    size_t *offset = malloc(sizeof *offset*(n_group + 1));
    strcpy(reason, "no memory");
    if (code) code->emitter = linkdyn_emit_open(set, lanes, a->columns, a->n_step, n_group, functions);
    if (!code || !offset || !code->emitter) {
        linkdyn_free_code(code);
        free(offset);
        return NULL;
    }
    code->width = a->columns*linkdyn_emit_width(set);
    size_t k = 0;
    for (int g = 0; g < n_group; g++) {
        offset[g] = linkdyn_emit_begin(code->emitter);
        for (; k < end[g]; k++) linkdyn_emit_step(code->emitter, &a->step[k]);
        linkdyn_emit_end(code->emitter);
    }
    const char *base = linkdyn_emit_close(code->emitter, reason);
    for (int g = 0; base && g < n_group; g++) code->entry[g] = (code_function)(uintptr_t)(base + offset[g]);
    free(offset);
    if (base) return code;
    linkdyn_free_code(code);
    return NULL;
}

static struct code *make_columns(const struct lane_line *line, int columns, enum code_set set, int lanes,
                                 const struct lane_functions *functions, char reason[EMIT_REASON])
{
    struct allocation a = {.line = line, .columns = columns, .n_register = linkdyn_emit_registers(set), .repeats = set != CODE_AVX2};
    struct needs *needs = find_needs(line);
    size_t *end = malloc(sizeof *end*(line->n_group + 1));
    struct code *code = NULL;
    for (int r = 0; r < MOST_REGISTERS; r++) a.held[r] = -1;
    a.home = malloc(sizeof *a.home*(line->n_slot + 1));
    a.next = malloc(sizeof *a.next*(line->n_slot + 1));
    a.is_stored = malloc(line->n_slot + 1);
    strcpy(reason, "no memory");
    if (needs && end && a.home && a.next && a.is_stored && allocate(&a, needs, end))
        code = encode(&a, end, set, lanes, functions, reason);
    free(needs);
    free(end);
    free(a.home);
    free(a.next);
    free(a.is_stored);
    free(a.step);
    return code;
}

struct code *linkdyn_make_code(const struct lane_line *line, enum code_set set, int lanes, const struct lane_functions *functions,
                               char reason[EMIT_REASON])
{
    return make_columns(line, 1, set, lanes, functions, reason);
}

struct code *linkdyn_make_paired_code(const struct lane_line *line, enum code_set set, int lanes,
                                      const struct lane_functions *functions, char reason[EMIT_REASON])
{
    struct lane_line pair;
    struct code *code = NULL;
    strcpy(reason, "no memory");
    if (linkdyn_pair_line(line, &pair)) code = make_columns(&pair, 2, set, lanes, functions, reason);
    linkdyn_free_line(&pair);
    return code;
}

int linkdyn_code_width(const struct code *code) { return code->width; }

void linkdyn_free_code(struct code *code)
{
    if (!code) return;
    linkdyn_emit_free(code->emitter);
    free(code);
}

void linkdyn_run_code(const struct code *code, int group, double *slot, const double *constant, int count)
{
    code->entry[group](slot, constant, (count + code->width - 1)/code->width);
}
