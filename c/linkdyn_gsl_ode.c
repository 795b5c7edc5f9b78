#include "linkdyn_gsl_ode.h"

#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

struct linkdyn_gsl_ode {
    gsl_odeiv2_system system;
    gsl_odeiv2_driver *driver;
    linkdyn_ode_rates rates;
    linkdyn_ode_jacobian jacobian;
    void *context;
    unsigned long rejected_before;    /* the last reset */
    int is_explicit;
    double longest;                   /* step accepted so far */
    double *kept;                     /* y before a step */
    double *found;                    /* y after it */
    double *found_rate;
};

/* GSL_FAILURE lets GSL try a shorter step; any other code would end the run at once. */
static int call_rates(double t, const double y[], double rate[], void *params)
{
    linkdyn_gsl_ode *ode = params;
    return ode->rates(t, y, rate, ode->context) == 0 ? GSL_SUCCESS : GSL_FAILURE;
}

static int call_jacobian(double t, const double y[], double *jacobian, double dfdt[], void *params)
{
    linkdyn_gsl_ode *ode = params;
    return ode->jacobian(t, y, jacobian, dfdt, ode->context) == 0 ? GSL_SUCCESS : GSL_FAILURE;
}

static const gsl_odeiv2_step_type *find_stepper(const char *name)
{
    if (strcmp(name, "rkf45") == 0) return gsl_odeiv2_step_rkf45;
    if (strcmp(name, "rk8pd") == 0) return gsl_odeiv2_step_rk8pd;
    if (strcmp(name, "msbdf") == 0) return gsl_odeiv2_step_msbdf;
    return NULL;
}

linkdyn_gsl_ode *linkdyn_gsl_ode_new(const char *stepper, size_t n, linkdyn_ode_rates rates,
                                     linkdyn_ode_jacobian jacobian, void *context, double first_step,
                                     double rtol, double atol)
{
    const gsl_odeiv2_step_type *type = find_stepper(stepper);
    linkdyn_gsl_ode *ode = type ? calloc(1, sizeof *ode) : NULL;
    if (!ode) return NULL;
    ode->rates = rates;
    ode->jacobian = jacobian;
    ode->context = context;
    ode->system = (gsl_odeiv2_system){call_rates, call_jacobian, n, ode};
    ode->is_explicit = strcmp(stepper, "msbdf") != 0;
    ode->kept = malloc(n * sizeof *ode->kept);
    ode->found = malloc(n * sizeof *ode->found);
    ode->found_rate = malloc(n * sizeof *ode->found_rate);
    /* GSL's default error handler ends the program. */
    gsl_error_handler_t *before = gsl_set_error_handler_off();
    ode->driver = gsl_odeiv2_driver_alloc_y_new(&ode->system, type, first_step, atol, rtol);
    gsl_set_error_handler(before);
    if (ode->kept && ode->found && ode->found_rate && ode->driver) return ode;
    linkdyn_gsl_ode_free(ode);
    return NULL;
}

/* Largest error estimate of a trial step of length h, over what is allowed; HUGE_VAL if it cannot be taken. */
static double try_step(linkdyn_gsl_ode *ode, double *t, double h, double *y)
{
    gsl_odeiv2_driver *d = ode->driver;
    double worst = 0;
    if (gsl_odeiv2_evolve_apply_fixed_step(d->e, NULL, d->s, d->sys, t, h, y) != GSL_SUCCESS) return HUGE_VAL;
    for (size_t i = 0; i < ode->system.dimension; i++) {
        double allowed;
        gsl_odeiv2_control_errlevel(d->c, y[i], d->e->dydt_out[i], h, i, &allowed);
        double part = fabs(d->e->yerr[i]) / allowed;
        if (!(part <= worst)) worst = part;
    }
    return worst;
}

/* Near a change point rounding makes the rates rough, and the shorter the steps, the nearer they come: the run would
   never get past. A step cut to less than 1/500 of the longest so far is therefore looked at: an error that falls slower
   than the square of the step is not that of the method, which falls with its fifth power at least. Then a step
   of 1/100 of the longest is taken as it is. y, t and h hold the step found otherwise, or that one. */
static void leap_over_noise(linkdyn_gsl_ode *ode, double t_before, double t_end, double *t, double *h, double *y)
{
    gsl_odeiv2_evolve *e = ode->driver->e;
    size_t bytes = ode->system.dimension * sizeof *y;
    double leap = ode->longest / 100, t_found = *t, t_short = t_before, t_leap = t_before;
    if (t_before + leap >= t_end) return;
    memcpy(ode->found, y, bytes);
    memcpy(ode->found_rate, e->dydt_out, bytes);
    memcpy(y, ode->kept, bytes);
    double of_short = try_step(ode, &t_short, leap / 5, y);
    memcpy(y, ode->kept, bytes);
    double of_leap = try_step(ode, &t_leap, leap, y);
    if (of_leap < HUGE_VAL && of_leap < 25 * of_short) {
        *t = t_leap;
        *h = leap;
        return;
    }
    memcpy(y, ode->found, bytes);
    memcpy(e->dydt_out, ode->found_rate, bytes);
    *t = t_found;
}

int linkdyn_gsl_ode_step(linkdyn_gsl_ode *ode, double *t, double t_end, double *h, double *y)
{
    gsl_odeiv2_driver *d = ode->driver;
    double t_before = *t;
    size_t bytes = ode->system.dimension * sizeof *y;
    unsigned long rejected = d->e->failed_steps;
    memcpy(ode->kept, y, bytes);
    gsl_error_handler_t *before = gsl_set_error_handler_off();
    int code = gsl_odeiv2_evolve_apply(d->e, d->c, d->s, d->sys, t, t_end, h, y);
    if (code == GSL_SUCCESS && ode->is_explicit && d->e->failed_steps > rejected && *t - t_before < ode->longest / 500)
        leap_over_noise(ode, t_before, t_end, t, h, y);
    gsl_set_error_handler(before);
    if (code == GSL_SUCCESS && *t - t_before > ode->longest) ode->longest = *t - t_before;
    if (code != GSL_SUCCESS) {
        memcpy(y, ode->kept, bytes);
        *t = t_before;
    }
    return code;
}

int linkdyn_gsl_ode_reset(linkdyn_gsl_ode *ode)
{
    ode->rejected_before += ode->driver->e->failed_steps;
    return gsl_odeiv2_driver_reset(ode->driver);
}

unsigned long linkdyn_gsl_ode_rejected(const linkdyn_gsl_ode *ode)
{
    return ode->rejected_before + ode->driver->e->failed_steps;
}

void linkdyn_gsl_ode_free(linkdyn_gsl_ode *ode)
{
    if (!ode) return;
    if (ode->driver) gsl_odeiv2_driver_free(ode->driver);
    free(ode->kept);
    free(ode->found);
    free(ode->found_rate);
    free(ode);
}
