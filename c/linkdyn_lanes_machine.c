/* One machine of linkdyn_lanes.h. Compiled once for each instruction set, never with contraction of products and sums:
 * multiply-adds are instructions of the kernel, so that all machines agree to the last bit.
 *
 * MACHINE: its name. The rest follows from what the compiler may use.
 */
#include <math.h>
#include <string.h>

#include "linkdyn_lanes.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#if defined(__AVX512F__) && defined(__AVX512DQ__)
#define VECTOR_LANES 8
#define WIDE_VECTORS 2        /* 16 lanes: the slots of a hexapod then fit into the first cache; 32 lanes took a fifth longer */
#elif defined(__AVX2__) && defined(__FMA__)
#define VECTOR_LANES 4
#define WIDE_VECTORS 4
#else
#define VECTOR_LANES 2
#define WIDE_VECTORS 8
#endif
enum { LANES = VECTOR_LANES*WIDE_VECTORS };
enum { TABLE_HEAD = 2, MOST_PLACE_STEPS = 60 };    /* of look-ups in curves */

#define CONCAT2(a, b) a##b
#define CONCAT(a, b) CONCAT2(a, b)
#define QUOTED2(a) #a
#define QUOTED(a) QUOTED2(a)

/* ---------------------------------------------------------------- lanes side by side */

typedef double wide_vd __attribute__((vector_size(8*VECTOR_LANES), may_alias));
typedef int64_t wide_vi __attribute__((vector_size(8*VECTOR_LANES), may_alias));

#define vd wide_vd
#define vi wide_vi
#define DUP(x) ((vd){0} + (x))
#define vector_sine_cosine wide_sine_cosine
#define vector_arctangent wide_arctangent
#define vector_whole wide_whole
#define vector_take_coefficients wide_take_coefficients
#define vector_polynomial wide_polynomial
#define vector_small_sine_cosine wide_small_sine_cosine
#define vector_take_axes wide_take_axes
#define vector_look wide_look
#define vector_far wide_far
#define vector_best_piece wide_best_piece
#define vector_piece wide_piece
#define vector_place wide_place
#include "linkdyn_lanes_math.h"
#include "linkdyn_lanes_curve.h"

#if VECTOR_LANES == 8
static inline vd wide_multiply_add(vd a, vd b, vd c) { return (vd)_mm512_fmadd_pd((__m512d)a, (__m512d)b, (__m512d)c); }
static inline vd wide_multiply_subtract(vd a, vd b, vd c) { return (vd)_mm512_fmsub_pd((__m512d)a, (__m512d)b, (__m512d)c); }
static inline vd wide_subtract_product(vd a, vd b, vd c) { return (vd)_mm512_fnmadd_pd((__m512d)a, (__m512d)b, (__m512d)c); }
static inline vd wide_root(vd a) { return (vd)_mm512_sqrt_pd((__m512d)a); }
#elif VECTOR_LANES == 4
static inline vd wide_multiply_add(vd a, vd b, vd c) { return (vd)_mm256_fmadd_pd((__m256d)a, (__m256d)b, (__m256d)c); }
static inline vd wide_multiply_subtract(vd a, vd b, vd c) { return (vd)_mm256_fmsub_pd((__m256d)a, (__m256d)b, (__m256d)c); }
static inline vd wide_subtract_product(vd a, vd b, vd c) { return (vd)_mm256_fnmadd_pd((__m256d)a, (__m256d)b, (__m256d)c); }
static inline vd wide_root(vd a) { return (vd)_mm256_sqrt_pd((__m256d)a); }
#else
static inline vd wide_multiply_add(vd a, vd b, vd c) { return (vd){fma(a[0], b[0], c[0]), fma(a[1], b[1], c[1])}; }
static inline vd wide_multiply_subtract(vd a, vd b, vd c) { return (vd){fma(a[0], b[0], -c[0]), fma(a[1], b[1], -c[1])}; }
static inline vd wide_subtract_product(vd a, vd b, vd c) { return (vd){fma(-a[0], b[0], c[0]), fma(-a[1], b[1], c[1])}; }
static inline vd wide_root(vd a) { return (vd){sqrt(a[0]), sqrt(a[1])}; }
#endif
static inline vd wide_choose(vi yes, vd a, vd b) { return (vd)(((vi)a & yes) | ((vi)b & ~yes)); }

#define vector_multiply_add wide_multiply_add
#define vector_multiply_subtract wide_multiply_subtract
#define vector_subtract_product wide_subtract_product
#define vector_root wide_root
#define vector_choose(condition, yes, no) wide_choose((vi)(condition), yes, no)
#define VECTORS WIDE_VECTORS
#define INSTRUCTION instruction16
#define RUN run16
#include "linkdyn_lanes_run.h"
#undef INSTRUCTION
#undef RUN
#define INSTRUCTION instruction32
#define RUN run32
#include "linkdyn_lanes_run.h"
#undef INSTRUCTION
#undef RUN
#undef VECTORS
#undef vector_choose

/* ---------------------------------------------------------------- one sample alone: a vector of one */

typedef double one_vd __attribute__((vector_size(8), may_alias));
typedef int64_t one_vi __attribute__((vector_size(8), may_alias));

#undef vd
#undef vi
#undef vector_sine_cosine
#undef vector_arctangent
#undef vector_whole
#undef vector_take_coefficients
#undef vector_polynomial
#undef vector_small_sine_cosine
#undef vector_take_axes
#undef vector_look
#undef vector_far
#undef vector_best_piece
#undef vector_piece
#undef vector_place
#undef vector_multiply_add
#undef vector_multiply_subtract
#undef vector_subtract_product
#undef vector_root
#undef VECTOR_LANES
#define VECTOR_LANES 1
#define vd one_vd
#define vi one_vi
#define vector_sine_cosine one_sine_cosine
#define vector_arctangent one_arctangent
#define vector_whole one_whole
#define vector_take_coefficients one_take_coefficients
#define vector_polynomial one_polynomial
#define vector_small_sine_cosine one_small_sine_cosine
#define vector_take_axes one_take_axes
#define vector_look one_look
#define vector_far one_far
#define vector_best_piece one_best_piece
#define vector_piece one_piece
#define vector_place one_place
#include "linkdyn_lanes_math.h"
#include "linkdyn_lanes_curve.h"

static inline vd one_multiply_add(vd a, vd b, vd c) { return (vd){__builtin_fma(a[0], b[0], c[0])}; }
static inline vd one_multiply_subtract(vd a, vd b, vd c) { return (vd){__builtin_fma(a[0], b[0], -c[0])}; }
static inline vd one_subtract_product(vd a, vd b, vd c) { return (vd){__builtin_fma(-a[0], b[0], c[0])}; }
static inline vd one_root(vd a) { return (vd){__builtin_sqrt(a[0])}; }
static inline vd one_choose(vi yes, vd a, vd b) { return (vd)(((vi)a & yes) | ((vi)b & ~yes)); }

#define vector_multiply_add one_multiply_add
#define vector_multiply_subtract one_multiply_subtract
#define vector_subtract_product one_subtract_product
#define vector_root one_root
#define vector_choose(condition, yes, no) one_choose((vi)(condition), yes, no)
#define VECTORS 1
#define INSTRUCTION instruction16
#define RUN run_one16
#include "linkdyn_lanes_run.h"
#undef INSTRUCTION
#undef RUN
#define INSTRUCTION instruction32
#define RUN run_one32
#include "linkdyn_lanes_run.h"
#undef vd
#undef vi
#undef VECTOR_LANES

/* ---------------------------------------------------------------- functions that machine code calls */

static void call_wide_sine_cosine(const double *x, double *sine, double *cosine)
{
    wide_vd s, c;
    wide_sine_cosine(*(const wide_vd *)x, &s, &c);
    *(wide_vd *)sine = s;
    *(wide_vd *)cosine = c;
}

static void call_wide_arctangent(const double *y, const double *x, double *angle)
{
    *(wide_vd *)angle = wide_arctangent(*(const wide_vd *)y, *(const wide_vd *)x);
}

static void call_wide_piece(const double *place, double *out, const double *table, long which)
{
    *(wide_vd *)out = wide_piece(*(const wide_vd *)place, table, which);
}

static void call_wide_place(const double *a, const double *b, double *out, const double *table, long is_farthest)
{
    *(wide_vd *)out = wide_place(*(const wide_vd *)a, *(const wide_vd *)b, table, is_farthest);
}

static void call_one_sine_cosine(const double *x, double *sine, double *cosine)
{
    one_vd s, c;
    one_sine_cosine(*(const one_vd *)x, &s, &c);
    *(one_vd *)sine = s;
    *(one_vd *)cosine = c;
}

static void call_one_arctangent(const double *y, const double *x, double *angle)
{
    *(one_vd *)angle = one_arctangent(*(const one_vd *)y, *(const one_vd *)x);
}

static void call_one_piece(const double *place, double *out, const double *table, long which)
{
    *(one_vd *)out = one_piece(*(const one_vd *)place, table, which);
}

static void call_one_place(const double *a, const double *b, double *out, const double *table, long is_farthest)
{
    *(one_vd *)out = one_place(*(const one_vd *)a, *(const one_vd *)b, table, is_farthest);
}

/* ---------------------------------------------------------------- samples into lanes and back */

#if defined(__AVX512F__) && defined(__AVX512DQ__)

#define TILE 8
#define UNROLL _Pragma("GCC unroll 8")      /* or the tile would live in memory */
/* transpose 8 vectors of 8 */
static inline void turn_tile(__m512d r[8])
{
    __m512d t[8], u[8];
    UNROLL for (int k = 0; k < 4; k++) {
        t[2*k] = _mm512_unpacklo_pd(r[2*k], r[2*k + 1]);
        t[2*k + 1] = _mm512_unpackhi_pd(r[2*k], r[2*k + 1]);
    }
    const __m512i low = _mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13), high = _mm512_setr_epi64(2, 3, 10, 11, 6, 7, 14, 15);
    UNROLL for (int h = 0; h < 2; h++)
        UNROLL for (int k = 0; k < 2; k++) {
            u[4*h + k] = _mm512_permutex2var_pd(t[4*h + k], low, t[4*h + 2 + k]);
            u[4*h + 2 + k] = _mm512_permutex2var_pd(t[4*h + k], high, t[4*h + 2 + k]);
        }
    UNROLL for (int k = 0; k < 4; k++) {
        r[k] = _mm512_shuffle_f64x2(u[k], u[4 + k], 0x44);
        r[4 + k] = _mm512_shuffle_f64x2(u[k], u[4 + k], 0xee);
    }
}

static void gather(const double *source, long ld, int count, int n, double *slot)
{
    if (n == 1 && ld == 1 && count == LANES) {     /* one number a sample: nothing to turn */
        memcpy(slot, source, LANES*sizeof(double));
        return;
    }
    for (int k = 0; k < n; k += TILE) {
        const int m = n - k < TILE ? n - k : TILE;
        const __mmask8 mask = (__mmask8)((1u << m) - 1);
        for (int lane = 0; lane < LANES; lane += TILE) {
            __m512d r[TILE];
            UNROLL for (int l = 0; l < TILE; l++) {
                const int i = lane + l < count ? lane + l : count - 1;
                r[l] = _mm512_maskz_loadu_pd(mask, source + i*ld + k);
            }
            turn_tile(r);
            for (int j = 0; j < m; j++) _mm512_storeu_pd(slot + (long)(k + j)*LANES + lane, r[j]);
        }
    }
}

/* one number a sample: nothing to turn */
static uint64_t scatter_column(const double *slot, int32_t sign, double *target, int count)
{
    const __m512d flip = _mm512_set1_pd(sign < 0 ? -0.0 : 0.0);
    uint64_t bad = 0;
    for (int lane = 0; lane < count; lane += TILE) {
        const int last = count - lane < TILE ? count - lane : TILE;
        const __mmask8 mask = (__mmask8)((1u << last) - 1);
        const __m512d r = _mm512_xor_pd(_mm512_load_pd(slot + lane), flip), zero = _mm512_sub_pd(r, r);
        _mm512_mask_storeu_pd(target + lane, mask, r);
        bad |= (uint64_t)_mm512_mask_cmp_pd_mask(mask, zero, zero, _CMP_UNORD_Q) << lane;
    }
    return bad;
}

static uint64_t scatter(const double *slot, const int32_t *which, const int32_t *sign, int n, double *target, long ld, int count)
{
    if (n == 1 && ld == 1) return scatter_column(slot + (long)which[0]*LANES, sign[0], target, count);
    const __m512d zero = _mm512_setzero_pd();
    uint64_t bad = 0;
    for (int lane = 0; lane < count; lane += TILE) {
        const int last = count - lane < TILE ? count - lane : TILE;
        __m512d finite = zero;               /* stays zero while all numbers are finite */
        for (int k = 0; k < n; k += TILE) {
            const int m = n - k < TILE ? n - k : TILE;
            const __mmask8 mask = (__mmask8)((1u << m) - 1);
            __m512d r[TILE];
            UNROLL for (int j = 0; j < TILE; j++) {
                const int i = j < m ? k + j : k;
                r[j] = _mm512_load_pd(slot + (long)which[i]*LANES + lane);
                r[j] = _mm512_xor_pd(r[j], _mm512_set1_pd(sign[i] < 0 ? -0.0 : 0.0));
                finite = _mm512_fmadd_pd(r[j], zero, finite);
            }
            turn_tile(r);
            UNROLL for (int l = 0; l < TILE; l++)
                if (l < last) _mm512_mask_storeu_pd(target + (lane + l)*ld + k, mask, r[l]);
        }
        bad |= (uint64_t)(_mm512_cmp_pd_mask(finite, finite, _CMP_UNORD_Q) & ((1u << last) - 1)) << lane;
    }
    return bad;
}

#else

static void gather(const double *source, long ld, int count, int n, double *slot)
{
    for (int lane = 0; lane < LANES; lane++) {
        const double *row = source + (lane < count ? lane : count - 1)*ld;
        for (int k = 0; k < n; k++) slot[(long)k*LANES + lane] = row[k];
    }
}

static uint64_t scatter(const double *slot, const int32_t *which, const int32_t *sign, int n, double *target, long ld, int count)
{
    uint64_t bad = 0;
    for (int lane = 0; lane < count; lane++) {
        double *row = target + lane*ld, finite = 0.0;    /* stays zero while all numbers are finite */
        for (int k = 0; k < n; k++) {
            const double x = slot[(long)which[k]*LANES + lane];
            row[k] = sign[k] < 0 ? -x : x;
            finite += x*0.0;
        }
        if (!(finite == 0.0)) bad |= (uint64_t)1 << lane;
    }
    return bad;
}

#endif

const struct lane_machine CONCAT(linkdyn_machine_, MACHINE) = {
    QUOTED(MACHINE), LANES,
#if defined(__FMA__) || defined(__ARM_FEATURE_FMA)
    1,
#else
    0,
#endif
    run16, run32, run_one16, run_one32,
    {call_wide_sine_cosine, call_wide_arctangent, call_wide_piece, call_wide_place},
    {call_one_sine_cosine, call_one_arctangent, call_one_piece, call_one_place},
    gather, scatter,
};
