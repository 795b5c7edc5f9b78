/* Sine, cosine and arctangent on vectors, branch-free: the same bits on every machine, since nothing here is contracted.
 *
 * Needs: vd, vi (vectors of doubles and of 64-bit integers), VECTOR_LANES, DUP(x), vector_any(x): is a bit of the signs set?
 */

/* The nearest whole number: numbers of 2^52 and more are whole. */
static inline vd vector_whole(vd x)
{
    vd magnitude = (vd)((vi)x & INT64_MAX);
    vd whole = (magnitude + DUP(0x1p52)) - DUP(0x1p52);
    vi large = ~(vi)(magnitude < DUP(0x1p52));
    return (vd)(((((vi)whole & ~large) | ((vi)magnitude & large)) & INT64_MAX) | ((vi)x & INT64_MIN));
}

/* Reduction by multiples of pi/2 in three pieces (Cody and Waite 1980), polynomials of fdlibm (Sun 1993), the
 * reduction's remainder carried along: within 0.6 units in the last place for |x| < 1.6e6. */
static inline void vector_sine_cosine(vd x, vd *sine, vd *cosine)
{
    const vd magic = DUP(0x1.8p52);
    const vd p1 = DUP(1.57079632673412561417e+00), p2 = DUP(6.07710050630396597660e-11), p3 = DUP(2.02226624879595063154e-21);
    vd t = x*DUP(0.63661977236758134308) + magic;
    vi q = (vi)t;
    vd n = t - magic;
    vd rest = x - n*p1;                       /* exact: p1 has 33 bits */
    vd w = n*p2;
    vd high = rest - w;
    vd low = ((rest - high) - w) - n*p3;
    vd r = high + low;
    vd tail = (high - r) + low;
    vd z = r*r;
    vd s = DUP(8.33333333332248946124e-03) + z*(DUP(-1.98412698298579493134e-04) + z*(DUP(2.75573137070700676789e-06)
         + z*(DUP(-2.50507602534068634195e-08) + z*DUP(1.58969099521155010221e-10))));
    vd v = z*r;
    s = r - ((z*(DUP(0.5)*tail - v*s) - tail) - v*DUP(-1.66666666666666324348e-01));
    vd c = z*(DUP(4.16666666666666019037e-02) + z*(DUP(-1.38888888888741095749e-03) + z*(DUP(2.48015872894767294178e-05)
         + z*(DUP(-2.75573143513906633035e-07) + z*(DUP(2.08757232129817482790e-09) + z*DUP(-1.13596475577881948265e-11))))));
    vd h = DUP(0.5)*z;
    vd d = DUP(1.0) - h;
    c = d + (((DUP(1.0) - d) - h) + (z*c - r*tail));
    vi odd = -(q & 1);
    vi sine_bits = ((vi)s & ~odd) | ((vi)c & odd);
    vi cosine_bits = ((vi)c & ~odd) | ((vi)s & odd);
    *sine = (vd)(sine_bits ^ ((q & 2) << 62));
    *cosine = (vd)(cosine_bits ^ (((q + 1) & 2) << 62));
    if (__builtin_expect(!vector_any(~(vi)((vd)((vi)x & INT64_MAX) < DUP(1.6e6))), 1)) return;
    for (int k = 0; k < VECTOR_LANES; k++) {  /* far away, infinite or no number: the library knows */
        if (__builtin_fabs(x[k]) < 1.6e6) continue;
        (*sine)[k] = sin(x[k]);
        (*cosine)[k] = cos(x[k]);
    }
}

/* Angle of the direction (x, y). The quotient of the smaller by the larger component, brought within 7/16 by the
 * arctangents of 1/2 and 1 (fdlibm's intervals), so that all lanes take the same way. */
static inline vd vector_arctangent(vd y, vd x)
{
    vd ax = (vd)((vi)x & INT64_MAX), ay = (vd)((vi)y & INT64_MAX);
    vi swapped = (vi)(ay > ax);
    vd larger = (vd)(((vi)ay & swapped) | ((vi)ax & ~swapped));
    vd smaller = (vd)(((vi)ax & swapped) | ((vi)ay & ~swapped));
    vi near_half = (vi)(smaller*DUP(16.0) > larger*DUP(7.0));
    vi near_one = (vi)(smaller*DUP(16.0) > larger*DUP(11.0));
    /* (smaller - k larger)/(larger + k smaller) with k = 0, 1/2, 1 */
    vd k = (vd)(((vi)DUP(0.5) & near_half & ~near_one) | ((vi)DUP(1.0) & near_one));
    vd high = (vd)(((vi)DUP(4.63647609000806093515e-01) & near_half & ~near_one) | ((vi)DUP(7.85398163397448278999e-01) & near_one));
    vd low = (vd)(((vi)DUP(2.26987774529616870924e-17) & near_half & ~near_one) | ((vi)DUP(3.06161699786838301793e-17) & near_one));
    vd t = (smaller - k*larger)/(larger + k*smaller);
    t = (vd)((vi)t & ~(vi)(larger == DUP(0.0)));            /* the zero vector has angle zero */
    vd z = t*t, w = z*z;
    vd odd = z*(DUP(3.33333333333329318027e-01) + w*(DUP(1.42857142725034663711e-01) + w*(DUP(9.09088713343650656196e-02)
           + w*(DUP(6.66107313738753120669e-02) + w*(DUP(4.97687799461593236017e-02) + w*DUP(1.62858201153657823623e-02))))));
    vd even = w*(DUP(-1.99999999998764832476e-01) + w*(DUP(-1.11111104054623557880e-01) + w*(DUP(-7.69187620504482999495e-02)
            + w*(DUP(-5.83357013379057348645e-02) + w*DUP(-3.65315727442169155270e-02)))));
    vd angle = high - ((t*(odd + even) - low) - t);          /* of smaller over larger, 0 to pi/4 */
    vd turned = DUP(1.57079632679489655800e+00) - (angle - DUP(6.12323399573676603587e-17));
    angle = (vd)(((vi)turned & swapped) | ((vi)angle & ~swapped));
    vd beyond = DUP(3.14159265358979311600e+00) - (angle - DUP(1.22464679914735320717e-16));
    vi left = (vi)x >> 63;                                   /* all ones where x is negative */
    angle = (vd)(((vi)beyond & left) | ((vi)angle & ~left));
    return (vd)((vi)angle | ((vi)y & INT64_MIN));
}
