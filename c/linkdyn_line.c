/* Operations of a record become steps on lanes. */
#include "linkdyn_line.h"

#include <stdlib.h>
#include <string.h>

/* Instructions as the schedule numbers them: the operations of a record, then those that join two. */
enum { OP_ADD = 4, OP_SUBTRACT, OP_MULTIPLY, OP_RECIPROCAL, OP_ROOT, OP_SINE, OP_COSINE, OP_ARCTANGENT, OP_MINIMUM, OP_MAXIMUM,
       OP_ABSOLUTE, OP_SELECT, OP_WHOLE, OP_PIECE, OP_NEAREST, OP_FARTHEST, OP_MULTIPLY_ADD, OP_MULTIPLY_SUBTRACT, OP_SUBTRACT_PRODUCT };

int linkdyn_is_constant(const struct lane_line *line, int slot)
{
    return slot >= line->first_constant && slot < line->first_constant + line->n_constant;
}

/* Of two operands that may change places, a constant becomes x and the last result c. */
static struct lane_step step_of(const struct lane_line *line, const struct record_step *s, int last)
{
    const int *o = s->operand;
    struct lane_step r = {.out = s->result, .second = NO_SLOT, .x = NO_SLOT, .b = NO_SLOT, .c = o[0]};
    switch (s->kind) {
    case OP_MULTIPLY_ADD: case OP_MULTIPLY_SUBTRACT: case OP_SUBTRACT_PRODUCT:
        r.kind = s->kind == OP_MULTIPLY_ADD ? LANE_MULTIPLY_ADD : s->kind == OP_MULTIPLY_SUBTRACT ? LANE_MULTIPLY_SUBTRACT
               : LANE_SUBTRACT_PRODUCT;
        r.x = o[0];
        r.b = o[1];
        r.c = o[2];
        if (linkdyn_is_constant(line, r.b)) swap_slots(&r.x, &r.b);
        break;
    case OP_ADD: case OP_MULTIPLY:
        r.kind = s->kind == OP_ADD ? LANE_ADD : LANE_MULTIPLY;
        r.x = o[0];
        r.c = o[1];
        if (r.x == last || linkdyn_is_constant(line, r.c)) swap_slots(&r.x, &r.c);
        if (linkdyn_is_constant(line, r.c) && !linkdyn_is_constant(line, r.x)) swap_slots(&r.x, &r.c);
        break;
    case OP_SUBTRACT:                                 /* o[0] - o[1] */
        r.kind = LANE_SUBTRACT;
        r.x = o[1];
        r.c = o[0];
        if (o[1] == last || (o[0] != last && linkdyn_is_constant(line, o[0]))) {
            r.kind = LANE_SUBTRACT_FROM;
            swap_slots(&r.x, &r.c);
        }
        break;
    case OP_MINIMUM: case OP_MAXIMUM: case OP_ARCTANGENT:
        r.kind = s->kind == OP_MINIMUM ? LANE_MINIMUM : s->kind == OP_MAXIMUM ? LANE_MAXIMUM : LANE_ARCTANGENT;
        r.x = o[0];
        r.c = o[1];
        break;
    case OP_SELECT:
        r.kind = LANE_SELECT;
        r.x = o[0];
        r.b = o[1];
        r.c = o[2];
        break;
    case OP_RECIPROCAL: r.kind = LANE_RECIPROCAL; break;
    case OP_ROOT: r.kind = LANE_ROOT; break;
    case OP_ABSOLUTE: r.kind = LANE_ABSOLUTE; break;
    case OP_WHOLE: r.kind = LANE_WHOLE; break;
    case OP_PIECE:
        r.kind = LANE_PIECE;
        r.table = s->table;
        r.which = s->which;
        break;
    case OP_NEAREST: case OP_FARTHEST:
        r.kind = s->kind == OP_NEAREST ? LANE_NEAREST : LANE_FARTHEST;
        r.table = s->table;
        r.b = o[1];
        break;
    default: r.kind = LANE_SINE_COSINE; break;
    }
    return r;
}

/* Sine and cosine of one angle are one step. The schedule puts them side by side, the sine first; what nobody wants goes to
 * the slot behind the last. Returns how many steps of the record these are. */
static int join_sine_cosine(const struct lane_line *line, const struct record_step *step, int n_left, struct lane_step *joined)
{
    joined->second = line->n_slot;
    if (step[0].kind == OP_COSINE) {
        swap_slots(&joined->out, &joined->second);
    } else if (n_left > 1 && step[1].kind == OP_COSINE && step[1].operand[0] == step[0].operand[0]) {
        joined->second = step[1].result;
        return 2;
    }
    return 1;
}

int linkdyn_make_line(int n_step, const struct record_step *step, const int32_t *output, int n_group, const int32_t *output_end,
                      const int32_t *step_end, struct lane_line *line)
{
    const int n_output = n_group > 0 ? output_end[n_group - 1] : 0;
    line->step = malloc(sizeof *line->step*(n_step + 1));
    line->step_end = malloc(sizeof *line->step_end*(n_group + 1));
    line->output_end = malloc(sizeof *line->output_end*(n_group + 1));
    line->output = malloc(sizeof *line->output*(n_output + 1));
    if (!line->step || !line->step_end || !line->output_end || !line->output) return 0;
    memcpy(line->output_end, output_end, sizeof *output_end*n_group);
    memcpy(line->output, output, sizeof *output*n_output);
    line->n_group = n_group;
    line->n_step = 0;
    for (int g = 0, k = 0; g < n_group; g++) {
        int last = NO_SLOT;                           /* the slot that the step before has written, if it leaves an accumulator */
        while (k < step_end[g]) {
            struct lane_step *s = &line->step[line->n_step++];
            *s = step_of(line, &step[k], last);
            last = leaves_accumulator(s->kind) ? s->out : NO_SLOT;
            k += s->kind == LANE_SINE_COSINE ? join_sine_cosine(line, &step[k], step_end[g] - k, s) : 1;
        }
        line->step_end[g] = line->n_step;
    }
    return 1;
}

/* Cycles until a result is there, on processors of today. */
static int cycles_of(int kind)
{
    enum { ARITHMETIC = 4, DIVISION = 13, ROOT = 20, CALL = 80 };
    if (kind >= LANE_ARCTANGENT) return CALL;
    return kind == LANE_RECIPROCAL ? DIVISION : kind == LANE_ROOT ? ROOT : ARITHMETIC;
}

long linkdyn_longest_chain(const struct lane_line *line)
{
    long *ready = calloc(line->n_slot + 1, sizeof *ready), longest = 0;
    if (!ready) return 0;
    for (int k = 0; k < line->n_step; k++) {
        const struct lane_step *s = &line->step[k];
        const int operand[3] = {s->x, s->b, s->c};
        long begin = 0;
        for (int i = 0; i < 3; i++)
            if (operand[i] != NO_SLOT && ready[operand[i]] > begin) begin = ready[operand[i]];
        ready[s->out] = begin + cycles_of(s->kind);
        if (s->second != NO_SLOT) ready[s->second] = ready[s->out];
        if (ready[s->out] > longest) longest = ready[s->out];
    }
    free(ready);
    return longest;
}

static int slot_of_column(const struct lane_line *line, int slot, int column)
{
    if (slot == NO_SLOT) return NO_SLOT;
    return 2*slot + (linkdyn_is_constant(line, slot) ? 0 : column);
}

int linkdyn_pair_line(const struct lane_line *line, struct lane_line *pair)
{
    const int n_output = line->n_group > 0 ? line->output_end[line->n_group - 1] : 0;
    *pair = (struct lane_line){.n_step = 2*line->n_step, .n_group = line->n_group, .n_slot = 2*line->n_slot + 1,
        .first_constant = 2*line->first_constant, .n_constant = 2*line->n_constant};
    pair->step = malloc(sizeof *pair->step*(pair->n_step + 1));
    pair->step_end = malloc(sizeof *pair->step_end*(line->n_group + 1));
    pair->output_end = malloc(sizeof *pair->output_end*(line->n_group + 1));
    pair->output = malloc(sizeof *pair->output*(2*n_output + 1));
    if (!pair->step || !pair->step_end || !pair->output_end || !pair->output) return 0;
    for (int c = 0; c < 2; c++) {
        for (int k = 0; k < line->n_step; k++) {
            struct lane_step *s = &pair->step[2*k + c];
            *s = line->step[k];
            s->out = slot_of_column(line, s->out, c);
            s->second = slot_of_column(line, s->second, c);
            s->x = slot_of_column(line, s->x, c);
            s->b = slot_of_column(line, s->b, c);
            s->c = slot_of_column(line, s->c, c);
        }
        for (int i = 0; i < n_output; i++) pair->output[2*i + c] = slot_of_column(line, line->output[i], c);
    }
    for (int g = 0; g < line->n_group; g++) {
        pair->step_end[g] = 2*line->step_end[g];
        pair->output_end[g] = 2*line->output_end[g];
    }
    return 1;
}

void linkdyn_free_line(struct lane_line *line)
{
    free(line->step);
    free(line->step_end);
    free(line->output_end);
    free(line->output);
}

int *linkdyn_count_reads(const struct lane_line *line)
{
    int *reads = calloc(line->n_step + 1, sizeof *reads), *writer = malloc(sizeof *writer*(line->n_slot + 1));
    if (!reads || !writer) {
        free(reads);
        free(writer);
        return NULL;
    }
    for (int k = 0; k <= line->n_slot; k++) writer[k] = line->n_step;
    for (int g = 0, k = 0, taken = 0; g < line->n_group; g++) {
        for (; k < line->step_end[g]; k++) {
            const int operand[3] = {line->step[k].x, line->step[k].b, line->step[k].c};
            for (int i = 0; i < 3; i++)
                if (operand[i] != NO_SLOT) reads[writer[operand[i]]]++;
            writer[line->step[k].out] = k;
            if (line->step[k].second != NO_SLOT) writer[line->step[k].second] = line->n_step;
        }
        for (; taken < line->output_end[g]; taken++) reads[writer[line->output[taken]]] += 2;
    }
    free(writer);
    return reads;
}
