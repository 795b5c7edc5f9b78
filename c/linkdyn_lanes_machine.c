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

#if VECTOR_LANES == 8
static inline int wide_any(wide_vi x) { return _mm512_movepi64_mask((__m512i)x) != 0; }
#elif VECTOR_LANES == 4
static inline int wide_any(wide_vi x) { return _mm256_movemask_pd((__m256d)x) != 0; }
#else
static inline int wide_any(wide_vi x) { return (x[0] | x[1]) < 0; }
#endif

#define vd wide_vd
#define vi wide_vi
#define DUP(x) ((vd){0} + (x))
#define vector_any wide_any
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

static inline int one_any(one_vi x) { return x[0] < 0; }

#undef vd
#undef vi
#undef vector_any
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
#define vector_any one_any
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

__attribute__((flatten)) static void call_wide_sine_cosine(const double *x, double *sine, double *cosine)
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

__attribute__((flatten)) static void call_one_sine_cosine(const double *x, double *sine, double *cosine)
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

#define UNROLL _Pragma("GCC unroll 8")      /* or the tile would live in memory */

#if defined(__AVX512F__) && defined(__AVX512DQ__)

enum { TILE = 8 };
typedef __m512d row;
typedef __mmask8 part;                      /* the first numbers of a row */

static inline part part_of(int n) { return (part)((1u << n) - 1); }
static inline row load_part(const double *x, part p) { return _mm512_maskz_loadu_pd(p, x); }
static inline void store_part(double *x, part p, row r) { _mm512_mask_storeu_pd(x, p, r); }
static inline row load_row(const double *x) { return _mm512_load_pd(x); }
static inline void store_row(double *x, row r) { _mm512_store_pd(x, r); }
static inline row repeat(double x) { return _mm512_set1_pd(x); }
static inline row turn_sign(row r, row flip) { return _mm512_xor_pd(r, flip); }
static inline row add_zero_times(row r, row sum) { return _mm512_fmadd_pd(r, _mm512_setzero_pd(), sum); }
static inline uint64_t not_a_number(row r) { return _mm512_cmp_pd_mask(r, r, _CMP_UNORD_Q); }

/* transpose 8 vectors of 8 */
static inline void turn_tile(row r[TILE])
{
    row t[8], u[8];
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

#elif defined(__AVX2__) && defined(__FMA__)

enum { TILE = 4 };
typedef __m256d row;
typedef int part;                           /* how many of a row's numbers, from the first */

/* Masked loads and stores take some ten times as long here. */
static inline part part_of(int n) { return n; }
static inline row load_part(const double *x, part n)
{
    switch (n) {
    case 1: return _mm256_set_m128d(_mm_setzero_pd(), _mm_load_sd(x));
    case 2: return _mm256_set_m128d(_mm_setzero_pd(), _mm_loadu_pd(x));
    case 3: return _mm256_set_m128d(_mm_load_sd(x + 2), _mm_loadu_pd(x));
    default: return _mm256_loadu_pd(x);
    }
}
static inline void store_part(double *x, part n, row r)
{
    switch (n) {
    case 1: _mm_store_sd(x, _mm256_castpd256_pd128(r)); break;
    case 2: _mm_storeu_pd(x, _mm256_castpd256_pd128(r)); break;
    case 3:
        _mm_storeu_pd(x, _mm256_castpd256_pd128(r));
        _mm_store_sd(x + 2, _mm256_extractf128_pd(r, 1));
        break;
    default: _mm256_storeu_pd(x, r);
    }
}
static inline row load_row(const double *x) { return _mm256_load_pd(x); }
static inline void store_row(double *x, row r) { _mm256_store_pd(x, r); }
static inline row repeat(double x) { return _mm256_set1_pd(x); }
static inline row turn_sign(row r, row flip) { return _mm256_xor_pd(r, flip); }
static inline row add_zero_times(row r, row sum) { return _mm256_fmadd_pd(r, _mm256_setzero_pd(), sum); }
static inline uint64_t not_a_number(row r) { return (unsigned)_mm256_movemask_pd(_mm256_cmp_pd(r, r, _CMP_UNORD_Q)); }

/* transpose 4 vectors of 4 */
static inline void turn_tile(row r[TILE])
{
    const row a = _mm256_unpacklo_pd(r[0], r[1]), b = _mm256_unpackhi_pd(r[0], r[1]);
    const row c = _mm256_unpacklo_pd(r[2], r[3]), d = _mm256_unpackhi_pd(r[2], r[3]);
    r[0] = _mm256_permute2f128_pd(a, c, 0x20);
    r[1] = _mm256_permute2f128_pd(b, d, 0x20);
    r[2] = _mm256_permute2f128_pd(a, c, 0x31);
    r[3] = _mm256_permute2f128_pd(b, d, 0x31);
}

#endif

#if (defined(__AVX512F__) && defined(__AVX512DQ__)) || (defined(__AVX2__) && defined(__FMA__))

static inline int smaller(int a, int b) { return a < b ? a : b; }

/* -0.0 or 0.0, without a branch */
static inline double flip_of(int32_t sign)
{
    const uint64_t bits = (uint64_t)(int64_t)sign & (uint64_t)1 << 63;
    double flip;
    memcpy(&flip, &bits, sizeof flip);
    return flip;
}

/* one sample for all lanes */
static void spread(const double *source, int n, double *slot)
{
    for (int k = 0; k < n; k++)
        UNROLL for (int lane = 0; lane < LANES; lane += TILE) store_row(slot + (long)k*LANES + lane, repeat(source[k]));
}

/* n numbers of all samples, no more than a row has */
static inline __attribute__((always_inline)) void gather_tiles(const double *source, long ld, int count, int n, double *slot)
{
    const part p = part_of(n);
    for (int lane = 0; lane < count; lane += TILE) {
        row r[TILE];
        UNROLL for (int l = 0; l < TILE; l++) r[l] = load_part(source + smaller(lane + l, count - 1)*ld, p);
        turn_tile(r);
        UNROLL for (int j = 0; j < TILE; j++)
            if (j < n) store_row(slot + (long)j*LANES + lane, r[j]);
    }
}

static void gather(const double *source, long ld, int count, int n, double *slot)
{
    if (n == 1 && ld == 1 && count == LANES) {     /* one number a sample: nothing to turn */
        memcpy(slot, source, LANES*sizeof(double));
        return;
    }
    if (ld == 0) {
        spread(source, n, slot);
        return;
    }
    int k = 0;
    for (; k + TILE <= n; k += TILE) gather_tiles(source + k, ld, count, TILE, slot + (long)k*LANES);
    if (k < n) gather_tiles(source + k, ld, count, n - k, slot + (long)k*LANES);
}

static uint64_t scatter_columns(const double *slot, const int32_t *which, const int32_t *sign, int n, double *target, long ld,
                                int count)
{
    uint64_t bad = 0;
    for (int lane = 0; lane < count; lane += TILE) {
        const int last = smaller(count - lane, TILE);
        const part p = part_of(last);
        row finite = repeat(0.0);            /* stays zero while all numbers are finite */
        for (int k = 0; k < n; k++) {
            const row r = turn_sign(load_row(slot + (long)which[k]*LANES + lane), repeat(flip_of(sign[k])));
            store_part(target + k*ld + lane, p, r);
            finite = add_zero_times(r, finite);
        }
        bad |= (not_a_number(finite) & ((1u << last) - 1)) << lane;
    }
    return bad;
}

static uint64_t scatter(const double *slot, const int32_t *which, const int32_t *sign, int n, double *target, long ld, int count)
{
    if (n == 1 && ld == 1) return scatter_columns(slot, which, sign, 1, target, count, count);     /* nothing to turn */
    uint64_t bad = 0;
    for (int lane = 0; lane < count; lane += TILE) {
        const int last = smaller(count - lane, TILE);
        row finite = repeat(0.0);            /* stays zero while all numbers are finite */
        for (int k = 0; k < n; k += TILE) {
            const int m = smaller(n - k, TILE);
            const part p = part_of(m);
            row r[TILE];
            UNROLL for (int j = 0; j < TILE; j++) {
                const int i = j < m ? k + j : k;
                r[j] = turn_sign(load_row(slot + (long)which[i]*LANES + lane), repeat(flip_of(sign[i])));
                finite = add_zero_times(r[j], finite);
            }
            turn_tile(r);
            UNROLL for (int l = 0; l < TILE; l++)
                if (l < last) store_part(target + (lane + l)*ld + k, p, r[l]);
        }
        bad |= (not_a_number(finite) & ((1u << last) - 1)) << lane;
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

static uint64_t scatter_columns(const double *slot, const int32_t *which, const int32_t *sign, int n, double *target, long ld,
                                int count)
{
    uint64_t bad = 0;
    for (int lane = 0; lane < count; lane++) {
        double finite = 0.0;
        for (int k = 0; k < n; k++) {
            const double x = slot[(long)which[k]*LANES + lane];
            target[k*ld + lane] = sign[k] < 0 ? -x : x;
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
    gather, scatter, scatter_columns,
};
