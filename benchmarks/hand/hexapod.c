/* Leg axes: z = s from the universal to the spherical joint, y = unit(s x u), x = y x z, so that the first axis of the universal joint
   is u = (m, 0, c); docs/theory.md derives them. Each leg's own equations leave one unknown, its axial force at the spherical joint;
   the platform's six equations give all six. */
#include "hexapod.h"

#include <math.h>

typedef struct {
    wide x, y, z;
} vec;

static inline vec add(vec a, vec b) { return (vec){a.x + b.x, a.y + b.y, a.z + b.z}; }
static inline vec subtract(vec a, vec b) { return (vec){a.x - b.x, a.y - b.y, a.z - b.z}; }
static inline vec scale(wide s, vec a) { return (vec){s * a.x, s * a.y, s * a.z}; }
static inline wide dot(vec a, vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline vec cross(vec a, vec b) { return (vec){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
static inline vec spread(const double a[3]) { return (vec){a[0] + (wide){0}, a[1] + (wide){0}, a[2] + (wide){0}}; }

/* Columns are the axes. */
typedef struct {
    vec x, y, z;
} axes;

static inline vec into(axes r, vec a) { return (vec){dot(r.x, a), dot(r.y, a), dot(r.z, a)}; }
static inline vec outof(axes r, vec a) { return add(add(scale(a.x, r.x), scale(a.y, r.y)), scale(a.z, r.z)); }

static inline vec times_inertia(const double j[6], vec w)
{
    return (vec){j[0] * w.x + j[3] * w.y + j[5] * w.z, j[3] * w.x + j[1] * w.y + j[4] * w.z, j[5] * w.x + j[4] * w.y + j[2] * w.z};
}

static inline wide root(wide a)
{
    wide r;
    for (int k = 0; k < LANES; k++) r[k] = sqrt(a[k]);
    return r;
}

/* To a few roundings for angles of some turns: reduced by quarter turns in two pieces, then Taylor's series. */
static inline void sine_cosine(wide angle, wide *sine, wide *cosine)
{
    const double magic = 0x1.8p52;                        /* adding it rounds to a whole number */
    wide quarter = (angle * 0x1.45f306dc9c883p-1 + magic) - magic;
    wide r = (angle - quarter * 0x1.921fb54442d18p0) - quarter * 0x1.1a62633145c07p-54, r2 = r * r;
    wide s = r + r * r2 * (-1.0 / 6 + r2 * (1.0 / 120 + r2 * (-1.0 / 5040 + r2 * (1.0 / 362880 + r2 * (-1.0 / 39916800
             + r2 * (1.0 / 6227020800 - r2 * (1.0 / 1307674368000)))))));
    wide c = 1 + r2 * (-0.5 + r2 * (1.0 / 24 + r2 * (-1.0 / 720 + r2 * (1.0 / 40320 + r2 * (-1.0 / 3628800
             + r2 * (1.0 / 479001600 + r2 * (-1.0 / 87178291200 + r2 * (1.0 / 20922789888000))))))));
    wide half = quarter * 0.5, odd = quarter - 2 * ((half + magic - 0.25) - magic);    /* 0 or 1 */
    wide fourth = (quarter - odd) * 0.5, turned = 1 - 2 * (fourth - 2 * ((fourth * 0.5 + magic - 0.25) - magic));    /* 1 or -1 */
    *sine = turned * (s + odd * (c - s));
    *cosine = turned * (c - odd * (c + s));
}

struct platform {
    axes r;
    vec position, velocity, acceleration, omega, alpha;
    vec force, moment;                                    /* what the legs have to give, about the origin */
};

static inline void move_platform(const struct hexapod *machine, const wide given[GIVEN], struct platform *p)
{
    const wide *angle = given + 3, *rate = given + 9, *second = given + 15;
    wide s[3], c[3];
    for (int k = 0; k < 3; k++) sine_cosine(angle[k], &s[k], &c[k]);
    p->r.x = (vec){c[1] * c[2], c[0] * s[2] + s[0] * s[1] * c[2], s[0] * s[2] - c[0] * s[1] * c[2]};
    p->r.y = (vec){-c[1] * s[2], c[0] * c[2] - s[0] * s[1] * s[2], s[0] * c[2] + c[0] * s[1] * s[2]};
    p->r.z = (vec){s[1], -s[0] * c[1], c[0] * c[1]};
    p->position = (vec){given[0], given[1], given[2]};
    p->velocity = (vec){given[6], given[7], given[8]};
    p->acceleration = (vec){given[12], given[13], given[14]};
    vec node = {(wide){0}, c[0], s[0]};                   /* the axis of the second angle; the first one's is x */
    vec first = add((vec){rate[0], (wide){0}, (wide){0}}, scale(rate[1], node));
    p->omega = add(first, scale(rate[2], p->r.z));
    p->alpha = add(add((vec){second[0], (wide){0}, (wide){0}}, scale(second[1], node)), scale(second[2], p->r.z));
    vec turning = {(wide){0}, -s[0] * rate[0] * rate[1], c[0] * rate[0] * rate[1]};
    p->alpha = add(p->alpha, add(turning, scale(rate[2], cross(first, p->r.z))));

    const struct body *b = &machine->platform;
    vec arm = outof(p->r, spread(b->cog)), gravity = spread(machine->gravity);
    vec a = add(p->acceleration, add(cross(p->alpha, arm), cross(p->omega, cross(p->omega, arm))));
    vec w = into(p->r, p->omega), dw = into(p->r, p->alpha);
    vec turn = outof(p->r, add(times_inertia(b->inertia, dw), cross(w, times_inertia(b->inertia, w))));
    vec f = scale(b->mass + (wide){0}, subtract(a, gravity));
    p->force = subtract(f, (vec){given[18], given[19], given[20]});
    p->moment = subtract(add(turn, cross(arm, f)), (vec){given[21], given[22], given[23]});
}

/* What a leg keeps until its axial force is known. */
struct leg {
    vec sphere, lower_force, upper_force;                 /* leg axes; at the spherical joint without the axial part */
};

/* All of a leg but its axial force; what it does to the platform's equations. */
static inline void close_leg(const struct hexapod *machine, int i, struct platform *p, struct leg *leg, wide unknown[13], wide line[6])
{
    vec arm = outof(p->r, spread(machine->top[i]));
    vec tip = add(p->position, arm), u = spread(machine->axis[i]), gravity = spread(machine->gravity);
    vec v = add(p->velocity, cross(p->omega, arm));
    vec a = add(p->acceleration, add(cross(p->alpha, arm), cross(p->omega, cross(p->omega, arm))));
    vec span = subtract(tip, spread(machine->base[i])), across = cross(span, u);
    wide length2 = dot(span, span), length = root(length2), width = root(dot(across, across));
    wide per_both = 1 / (length * width), per_length = width * per_both;    /* one division serves both */
    axes e;
    e.z = scale(per_length, span);
    e.y = scale(length * per_both, across);
    wide c = dot(e.z, u), per_m = length2 * per_both, k = c * per_m;
    e.x = subtract(scale(per_m, u), scale(k, e.z));

    v = into(e, v);
    a = into(e, a);
    gravity = into(e, gravity);
    vec w = {-per_length * v.y, per_length * v.x, (wide){0}};
    w.z = k * w.x;
    vec dw = {w.z * w.y - per_length * (a.y + 2 * v.z * w.x), per_length * (a.x - 2 * v.z * w.y) - w.z * w.x, (wide){0}};
    dw.z = k * dw.x + (k * w.z + w.x) * w.y;

    const struct body *low = &machine->lower[i], *up = &machine->upper[i];
    vec c1 = spread(low->cog), c2 = spread(up->cog);
    vec a1 = add(cross(dw, c1), cross(w, cross(w, c1)));
    vec a2 = add(a, add(cross(dw, c2), cross(w, cross(w, c2))));
    leg->lower_force = scale(low->mass + (wide){0}, subtract(a1, gravity));
    leg->upper_force = scale(up->mass + (wide){0}, subtract(a2, gravity));
    vec h1 = add(times_inertia(low->inertia, dw), cross(w, times_inertia(low->inertia, w)));
    vec h2 = add(times_inertia(up->inertia, dw), cross(w, times_inertia(up->inertia, w)));
    vec moment1 = add(h1, cross(c1, leg->lower_force)), moment2 = add(h2, cross(c2, leg->upper_force));
    vec moment = add(moment1, moment2);                   /* of the whole leg about the universal joint */
    moment.x -= length * leg->upper_force.y;
    moment.y += length * leg->upper_force.x;

    wide normal = moment.z * per_m;
    leg->sphere = (vec){moment.y * per_length, -(moment.x + normal * c) * per_length, (wide){0}};
    unknown[6] = moment2.x;
    unknown[7] = moment2.y;
    unknown[8] = moment2.z;
    unknown[12] = normal;

    vec side = add(scale(leg->sphere.x, e.x), scale(leg->sphere.y, e.y));
    p->force = add(p->force, side);
    p->moment = add(p->moment, cross(arm, side));
    vec lever = cross(arm, e.z);
    line[0] = e.z.x;
    line[1] = e.z.y;
    line[2] = e.z.z;
    line[3] = lever.x;
    line[4] = lever.y;
    line[5] = lever.z;
}

/* Axial forces, in the order of the pivots. */
static inline void solve(const struct hexapod *machine, wide line[LEGS][6], const wide right[6], wide axial[LEGS])
{
    wide a[6][7], x[6];
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 6; j++) a[i][j] = line[machine->column[j]][machine->row[i]];
        a[i][6] = right[machine->row[i]];
    }
    for (int k = 0; k < 6; k++) {
        wide per_pivot = 1 / a[k][k];
        for (int j = k + 1; j < 7; j++) a[k][j] *= per_pivot;
        for (int i = k + 1; i < 6; i++)
            for (int j = k + 1; j < 7; j++) a[i][j] -= a[i][k] * a[k][j];
    }
    for (int k = 5; k >= 0; k--) {
        x[k] = a[k][6];
        for (int j = k + 1; j < 6; j++) x[k] -= a[k][j] * x[j];
        axial[machine->column[k]] = x[k];
    }
}

static inline void write_leg(const struct leg *leg, wide axial, wide unknown[13])
{
    vec slide = subtract(leg->upper_force, (vec){leg->sphere.x, leg->sphere.y, axial}), foot = add(leg->lower_force, slide);
    unknown[0] = leg->sphere.x;
    unknown[1] = leg->sphere.y;
    unknown[2] = axial;
    unknown[3] = slide.x;
    unknown[4] = slide.y;
    unknown[5] = slide.z;
    unknown[9] = foot.x;
    unknown[10] = foot.y;
    unknown[11] = foot.z;
}

void hexapod_forces(const struct hexapod *machine, long blocks, const wide given[][GIVEN], wide unknown[][UNKNOWNS])
{
    for (long b = 0; b < blocks; b++) {
        struct platform p;
        struct leg leg[LEGS];
        wide line[LEGS][6], axial[LEGS];
        move_platform(machine, given[b], &p);
        for (int i = 0; i < LEGS; i++) close_leg(machine, i, &p, &leg[i], &unknown[b][13 * i], line[i]);
        wide right[6] = {-p.force.x, -p.force.y, -p.force.z, -p.moment.x, -p.moment.y, -p.moment.z};
        solve(machine, line, right, axial);
        for (int i = 0; i < LEGS; i++) write_leg(&leg[i], axial[i], &unknown[b][13 * i]);
    }
}

void hexapod_order(struct hexapod *machine, const wide given[GIVEN])
{
    struct platform p;
    struct leg leg;
    wide line[LEGS][6], unknown[13];
    double a[6][6];
    move_platform(machine, given, &p);
    for (int i = 0; i < LEGS; i++) close_leg(machine, i, &p, &leg, unknown, line[i]);
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 6; j++) a[i][j] = line[j][i][0];
        machine->row[i] = machine->column[i] = i;
    }
    for (int k = 0; k < 6; k++) {
        int row = k, column = k;
        for (int i = k; i < 6; i++)
            for (int j = k; j < 6; j++)
                if (fabs(a[machine->row[i]][machine->column[j]]) > fabs(a[machine->row[row]][machine->column[column]])) row = i, column = j;
        int other = machine->row[k];
        machine->row[k] = machine->row[row];
        machine->row[row] = other;
        other = machine->column[k];
        machine->column[k] = machine->column[column];
        machine->column[column] = other;
        for (int i = k + 1; i < 6; i++) {
            double factor = a[machine->row[i]][machine->column[k]] / a[machine->row[k]][machine->column[k]];
            for (int j = k; j < 6; j++) a[machine->row[i]][machine->column[j]] -= factor * a[machine->row[k]][machine->column[j]];
        }
    }
}
