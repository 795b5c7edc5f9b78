/* The interpreter proper, included once for each width of lanes and of instructions.
 *
 * Needs: RUN (name), INSTRUCTION (struct), VECTORS (vectors a slot), vd, and the operations on vectors. A result that the
 * next instruction uses stays in registers (the accumulator); handlers jump to each other without a loop.
 */
#define UNROLLED _Pragma("GCC unroll 16") for (int i = 0; i < VECTORS; i++)
#define VALUE_MULTIPLY(X, C) X*C
#define VALUE_MULTIPLY_ADD(X, C) vector_multiply_add(X, b[i], C)
#define VALUE_SUBTRACT_PRODUCT(X, C) vector_subtract_product(X, b[i], C)
#define VALUE_MULTIPLY_SUBTRACT(X, C) vector_multiply_subtract(X, b[i], C)
#define VALUE_ADD(X, C) X + C
#define VALUE_SUBTRACT(X, C) C - X
#define VALUE_SUBTRACT_FROM(X, C) X - C
#define VALUE_RECIPROCAL(X, C) DUP(1.0)/C
#define VALUE_ROOT(X, C) vector_root(C)
#define VALUE_ABSOLUTE(X, C) (vd)((vi)(C) & INT64_MAX)
#define VALUE_WHOLE(X, C) vector_whole(C)
#define VALUE_MINIMUM(X, C) vector_choose(X < C, X, C)
#define VALUE_MAXIMUM(X, C) vector_choose(X > C, X, C)
#define VALUE_SELECT(X, C) vector_choose(X > DUP(0.0), b[i], C)
#define VALUE_ARCTANGENT(X, C) vector_arctangent(X, C)

#define FORMS(M, K) \
    M(K, 0, a[i], c[i]) M(K, 1, a[i], acc[i]) M(K, 2, a[i], c[i]) M(K, 3, a[i], acc[i]) \
    M(K, 4, x, c[i]) M(K, 5, x, acc[i]) M(K, 6, x, c[i]) M(K, 7, x, acc[i])
#define KINDS(M) M(MULTIPLY) M(MULTIPLY_ADD) M(SUBTRACT_PRODUCT) M(MULTIPLY_SUBTRACT) M(ADD) M(SUBTRACT) M(SUBTRACT_FROM) \
    M(RECIPROCAL) M(ROOT) M(ABSOLUTE) M(WHOLE) M(MINIMUM) M(MAXIMUM) M(SELECT) M(ARCTANGENT)

static void RUN(const struct INSTRUCTION *step, double *slot, const double *constant)
{
#define ADDRESS(K, F, X, C) [LANE_##K*8 + F] = &&do_##K##_##F,
#define ADDRESSES(K) FORMS(ADDRESS, K)
    static const void *const handler[LANE_KINDS*8] = {
        KINDS(ADDRESSES)
        [LANE_SINE_COSINE*8] = &&do_sine_cosine, [LANE_SINE_COSINE*8 + 1] = &&do_sine_cosine_acc,
        [LANE_PIECE*8] = &&do_piece, [LANE_NEAREST*8] = &&do_nearest, [LANE_FARTHEST*8] = &&do_farthest,
        [LANE_END*8] = &&end,
    };
    vd *const s = (vd *)slot;
    vd acc[VECTORS];
    UNROLLED acc[i] = DUP(0.0);
    goto *handler[step->code];

#define HANDLER(K, F, X, C) \
    do_##K##_##F: { \
        const vd *a = s + (long)VECTORS*((F & FORM_CONSTANT) ? 0 : step->a), *b = s + (long)VECTORS*step->b, \
                 *c = s + (long)VECTORS*step->c; \
        vd *out = s + (long)VECTORS*step->out; \
        const vd x = (F & FORM_CONSTANT) ? DUP(constant[step->a]) : DUP(0.0); \
        (void)a; (void)b; (void)c; (void)out; (void)x; \
        UNROLLED { vd r = VALUE_##K((X), (C)); acc[i] = r; if (F & FORM_STORE) out[i] = r; } \
        step++; \
        goto *handler[step->code]; \
    }
#define HANDLERS(K) FORMS(HANDLER, K)
    KINDS(HANDLERS)

do_sine_cosine_acc: {
        vd *out = s + (long)VECTORS*step->out, *second = s + (long)VECTORS*step->b;
        for (int i = 0; i < VECTORS; i++) vector_sine_cosine(acc[i], &out[i], &second[i]);
        step++;
        goto *handler[step->code];
    }
do_sine_cosine: {
        const vd *c = s + (long)VECTORS*step->c;
        vd *out = s + (long)VECTORS*step->out, *second = s + (long)VECTORS*step->b;
        for (int i = 0; i < VECTORS; i++) vector_sine_cosine(c[i], &out[i], &second[i]);
        step++;
        goto *handler[step->code];
    }
do_piece: {
        const vd *c = s + (long)VECTORS*step->c;
        vd *out = s + (long)VECTORS*step->out;
        for (int i = 0; i < VECTORS; i++) out[i] = vector_piece(c[i], constant + step->a, step->b);
        step++;
        goto *handler[step->code];
    }
#define PLACE_HANDLER(label, is_farthest) \
    label: { \
        const vd *b = s + (long)VECTORS*step->b, *c = s + (long)VECTORS*step->c; \
        vd *out = s + (long)VECTORS*step->out; \
        for (int i = 0; i < VECTORS; i++) out[i] = vector_place(c[i], b[i], constant + step->a, is_farthest); \
        step++; \
        goto *handler[step->code]; \
    }
    PLACE_HANDLER(do_nearest, 0)
    PLACE_HANDLER(do_farthest, 1)
end:
    return;
}
#undef ADDRESS
#undef ADDRESSES
#undef HANDLER
#undef HANDLERS
#undef PLACE_HANDLER
#undef FORMS
#undef KINDS
#undef UNROLLED
