/* Look-ups in closed curves on vectors: the same bits on every machine, since nothing here is contracted. What they find is said
 * in fortran/record/linkdyn_piecewise.f90, where the table is made: number of pieces; 0 or, of a polar curve, 1 for small pieces
 * and 2 for others; coefficients of both components; x and y of the points at which pieces begin, and of their directions.
 *
 * Needs: vd, vi (vectors of doubles and of 64-bit integers), VECTOR_LANES, DUP(x), vector_sine_cosine.
 */
/* a where yes, else b */
#define CHOICE(yes, a, b) ((vd)(((vi)(a) & (vi)(yes)) | ((vi)(b) & ~(vi)(yes))))

/* Polynomials of a component on a piece of each lane, with its coefficients. */
static inline void vector_take_coefficients(const double *table, vi piece, int component, vd c[4])
{
    const double *first = table + TABLE_HEAD + component*4*(long)table[0];
    for (int k = 0; k < 4; k++)
        for (int l = 0; l < VECTOR_LANES; l++) c[k][l] = first[4*piece[l] + k];
}

static inline vd vector_polynomial(const vd c[4], int order, vd t)
{
    switch (order) {
    case 0: return c[0] + t*(c[1] + t*(c[2] + t*c[3]));
    case 1: return c[1] + t*(DUP(2.0)*c[2] + t*(DUP(3.0)*c[3]));
    case 2: return DUP(2.0)*c[2] + t*(DUP(6.0)*c[3]);
    default: return DUP(6.0)*c[3] + DUP(0.0)*t;
    }
}

/* A component at a place, or a derivative of it: `which` is 4 component + order. */
static inline vd vector_piece(vd place, const double *table, long which)
{
    const vd last = DUP(table[0] - 1.0);
    vd within = CHOICE(place > DUP(0.0), place, DUP(0.0)), c[4];
    within = CHOICE(within < last, within, last);
    vi piece;
    for (int l = 0; l < VECTOR_LANES; l++) piece[l] = (int64_t)within[l];
    vd whole;
    for (int l = 0; l < VECTOR_LANES; l++) whole[l] = (double)piece[l];
    vector_take_coefficients(table, piece, (int)(which/4), c);
    return vector_polynomial(c, (int)(which%4), place - whole);
}

/* Sine and cosine of a small angle, by the polynomials of fdlibm (Sun 1993): within a unit in the last place up to pi/4. */
static inline void vector_small_sine_cosine(vd x, vd *sine, vd *cosine)
{
    const vd z = x*x;
    const vd s = DUP(8.33333333332248946124e-03) + z*(DUP(-1.98412698298579493134e-04) + z*(DUP(2.75573137070700676789e-06)
               + z*(DUP(-2.50507602534068634195e-08) + z*DUP(1.58969099521155010221e-10))));
    const vd c = DUP(4.16666666666666019037e-02) + z*(DUP(-1.38888888888741095749e-03) + z*(DUP(2.48015872894767294178e-05)
               + z*(DUP(-2.75573143513906633035e-07) + z*(DUP(2.08757232129817482790e-09) + z*DUP(-1.13596475577881948265e-11)))));
    *sine = x + z*x*(DUP(-1.66666666666666324348e-01) + z*s);
    *cosine = DUP(1.0) - (DUP(0.5)*z - z*z*c);
}

/* A point, or a direction, in axes along the radius with which each lane's piece begins; in those of the curve if it is not polar. */
static inline void vector_take_axes(const double *table, vi piece, vd a, vd b, vd p[2])
{
    const long n = (long)table[0];
    const double *x = table + TABLE_HEAD + 10*n, *y = x + n;
    vd cosine, sine;
    p[0] = a;
    p[1] = b;
    if (table[1] == 0.0) return;
    for (int l = 0; l < VECTOR_LANES; l++) {
        cosine[l] = x[piece[l]];
        sine[l] = y[piece[l]];
    }
    p[0] = cosine*a + sine*b;
    p[1] = cosine*b - sine*a;
}

/* What vanishes at the best place, and how it grows with the part of the piece. */
static inline void vector_look(const vd c[2][4], double form, int is_farthest, vd part, const vd p[2], vd *slope, vd *growth)
{
    const vd u = vector_polynomial(c[0], 0, part), u1 = vector_polynomial(c[0], 1, part), u2 = vector_polynomial(c[0], 2, part);
    vd q[2] = {p[0], p[1]}, at[2], first[2], second[2];
    if (form > 0.0) {                         /* polar: in axes along the radius there, which has turned since the piece began */
        const vd v1 = c[1][1];
        vd sine, cosine;
        if (form > 1.0) vector_sine_cosine(v1*part, &sine, &cosine);
        else vector_small_sine_cosine(v1*part, &sine, &cosine);
        q[0] = cosine*p[0] + sine*p[1];
        q[1] = cosine*p[1] - sine*p[0];
        at[0] = u;
        at[1] = DUP(0.0);
        first[0] = u1;
        first[1] = u*v1;
        second[0] = u2 - u*v1*v1;
        second[1] = DUP(2.0)*u1*v1;
    } else {
        at[0] = u;
        at[1] = vector_polynomial(c[1], 0, part);
        first[0] = u1;
        first[1] = vector_polynomial(c[1], 1, part);
        second[0] = u2;
        second[1] = vector_polynomial(c[1], 2, part);
    }
    if (is_farthest) {
        *slope = -(first[0]*q[0] + first[1]*q[1]);
        *growth = -(second[0]*q[0] + second[1]*q[1]);
    } else {
        *slope = (at[0] - q[0])*first[0] + (at[1] - q[1])*first[1];
        *growth = (first[0]*first[0] + first[1]*first[1]) + ((at[0] - q[0])*second[0] + (at[1] - q[1])*second[1]);
    }
}

/* How far points are from (a, b), squared; against the direction (a, b), if the farthest is looked for. */
static inline vd vector_far(int is_farthest, vd x, vd y, vd a, vd b)
{
    return is_farthest ? -(x*a + y*b) : (x - a)*(x - a) + (y - b)*(y - b);
}

/* The point at which a piece begins that is nearest to (a, b), or farthest in that direction: the first of the best. Points are
 * looked at in rows, so that a processor has several to do at a time; a row keeps the first of its own. */
static inline vi vector_best_piece(const double *table, int is_farthest, vd a, vd b)
{
    enum { ROWS = VECTOR_LANES == 1 ? 8 : 2 };
    const long n = (long)table[0];
    const double *x = table + TABLE_HEAD + 8*n, *y = x + n;
    vd best[ROWS];
    vi piece[ROWS];
    for (long k = 0; k < ROWS; k++) {
        const long i = k < n ? k : 0;
        best[k] = vector_far(is_farthest, DUP(x[i]), DUP(y[i]), a, b);
        piece[k] = (vi){0} + i;
    }
    for (long k = ROWS; k < n; k += ROWS) {
        _Pragma("GCC unroll 8") for (int r = 0; r < ROWS; r++) {
            const long i = k + r < n ? k + r : 0;
            const vd far = vector_far(is_farthest, DUP(x[i]), DUP(y[i]), a, b);
            const vi better = (vi)(far < best[r]);
            best[r] = CHOICE(better, far, best[r]);
            piece[r] = (((vi){0} + i) & better) | (piece[r] & ~better);
        }
    }
    for (int r = 1; r < ROWS; r++) {
        const vi better = (vi)(best[r] < best[0]) | ((vi)(best[r] == best[0]) & (vi)(piece[r] < piece[0]));
        best[0] = CHOICE(better, best[r], best[0]);
        piece[0] = (piece[r] & better) | (piece[0] & ~better);
    }
    return piece[0];
}

/* The place nearest to a point, or farthest in a direction. Lanes that are done wait for the others. */
static inline vd vector_place(vd a, vd b, const double *table, long is_farthest)
{
    const int is_far = is_farthest != 0;
    const long n = (long)table[0];
    vi piece = vector_best_piece(table, is_far, a, b);
    vd c[2][4], p[2], slope, growth;
    for (int k = 0; k < 2; k++) vector_take_coefficients(table, piece, k, c[k]);
    vector_take_axes(table, piece, a, b, p);
    vector_look(c, table[1], is_far, DUP(0.0), p, &slope, &growth);
    const vi before = (vi)(slope > DUP(0.0));
    for (int l = 0; l < VECTOR_LANES; l++)
        if (before[l]) piece[l] = piece[l] > 0 ? piece[l] - 1 : n - 1;
    for (int k = 0; k < 2; k++) vector_take_coefficients(table, piece, k, c[k]);
    vector_take_axes(table, piece, a, b, p);
    vd part = CHOICE(before, DUP(1.0), DUP(0.0)), low = DUP(0.0), high = DUP(1.0);
    vi busy = ~(vi){0};
    for (int step = 0; step < MOST_PLACE_STEPS; step++) {
        vector_look(c, table[1], is_far, part, p, &slope, &growth);
        const vi above = (vi)(slope > DUP(0.0));
        high = CHOICE(above, part, high);
        low = CHOICE(above, low, part);
        vd next = part - slope/growth;
        const vi sound = (vi)(growth > DUP(0.0)) & (vi)(next >= low) & (vi)(next <= high);
        next = CHOICE(sound, next, (low + high)*DUP(0.5));
        const vd move = (vd)((vi)(next - part) & INT64_MAX);
        part = CHOICE(busy, next, part);
        /* Newton's method squares what is left */
        busy &= ~((vi)(move <= DUP(0x1p-52)) | ((vi)(move <= DUP(0x1p-32)) & sound));
        int is_any = 0;
        for (int l = 0; l < VECTOR_LANES; l++) is_any |= busy[l] != 0;
        if (!is_any) break;
    }
    vd whole;
    for (int l = 0; l < VECTOR_LANES; l++) whole[l] = (double)piece[l];
    return whole + part;
}
#undef CHOICE
