#include "linkdyn_gsl_ode.h"

#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* What GSL's callbacks get. */
typedef struct {
    linkdyn_ode_rates rates;
    linkdyn_ode_jacobian jacobian;
    void *context;
} caller;

/* GSL_FAILURE lets GSL try a shorter step; any other code would end the run at once. */
static int call_rates(double t, const double y[], double rate[], void *params)
{
    caller *of = params;
    return of->rates(t, y, rate, of->context) == 0 ? GSL_SUCCESS : GSL_FAILURE;
}

static int call_jacobian(double t, const double y[], double *jacobian, double dfdt[], void *params)
{
    caller *of = params;
    return of->jacobian(t, y, jacobian, dfdt, of->context) == 0 ? GSL_SUCCESS : GSL_FAILURE;
}

/* ---------------------------------------------------------------- explicit methods */

struct linkdyn_gsl_stepper {
    caller caller;
    gsl_odeiv2_system system;
    gsl_odeiv2_step *step;
};

static const gsl_odeiv2_step_type *find_stepper(const char *name)
{
    if (strcmp(name, "rkf45") == 0) return gsl_odeiv2_step_rkf45;
    if (strcmp(name, "rk8pd") == 0) return gsl_odeiv2_step_rk8pd;
    return NULL;
}

linkdyn_gsl_stepper *linkdyn_gsl_stepper_new(const char *name, size_t n, linkdyn_ode_rates rates, void *context)
{
    const gsl_odeiv2_step_type *type = find_stepper(name);
    linkdyn_gsl_stepper *stepper = type ? calloc(1, sizeof *stepper) : NULL;
    if (!stepper) return NULL;
    stepper->caller = (caller){rates, NULL, context};
    stepper->system = (gsl_odeiv2_system){call_rates, NULL, n, &stepper->caller};
    /* GSL's default error handler ends the program. */
    gsl_error_handler_t *before = gsl_set_error_handler_off();
    stepper->step = gsl_odeiv2_step_alloc(type, n);
    gsl_set_error_handler(before);
    if (stepper->step) return stepper;
    free(stepper);
    return NULL;
}

unsigned linkdyn_gsl_stepper_order(const linkdyn_gsl_stepper *stepper)
{
    return gsl_odeiv2_step_order(stepper->step);
}

int linkdyn_gsl_stepper_step(linkdyn_gsl_stepper *stepper, double t, double h, double *y, double *error,
                             const double *rate)
{
    gsl_error_handler_t *before = gsl_set_error_handler_off();
    int code = gsl_odeiv2_step_apply(stepper->step, t, h, y, error, rate, NULL, &stepper->system);
    gsl_set_error_handler(before);
    return code;
}

void linkdyn_gsl_stepper_free(linkdyn_gsl_stepper *stepper)
{
    if (!stepper) return;
    gsl_odeiv2_step_free(stepper->step);
    free(stepper);
}

/* ---------------------------------------------------------------- the error that msbdf may make */

typedef struct {
    double rtol;
    const double *atol, *largest;
} allowance;

static int errlevel(void *state, const double y, const double dydt, const double h, const size_t i, double *level)
{
    const allowance *allowed = state;
    (void)dydt;
    (void)h;
    *level = allowed->atol[i] + allowed->rtol * fmin(fabs(y), allowed->largest[i]);
    if (allowed->largest[i] < 0) *level = HUGE_VAL;
    return GSL_SUCCESS;
}

/* GSL's own rule for the next step, with the error allowed as above. */
static int hadjust(void *state, size_t n, unsigned order, const double y[], const double error[], const double rate[],
                   double *h)
{
    double worst = 0, before = *h;
    for (size_t i = 0; i < n; i++) {
        double level;
        errlevel(state, y[i], rate[i], before, i, &level);
        double part = fabs(error[i]) / level;
        if (!(part <= worst)) worst = part;
    }
    if (!(worst <= 1.1)) {
        *h = before * fmax(0.2, 0.9 / pow(worst, 1.0 / order));
        if (!(*h < before)) *h = before / 5;      /* not a number */
        return GSL_ODEIV_HADJ_DEC;
    }
    if (worst < 0.5) {
        *h = before * fmin(5.0, fmax(1.0, 0.9 / pow(worst, 1.0 / (order + 1.0))));
        return GSL_ODEIV_HADJ_INC;
    }
    return GSL_ODEIV_HADJ_NIL;
}

static int set_driver(void *state, const gsl_odeiv2_driver *driver)
{
    (void)state;
    (void)driver;
    return GSL_SUCCESS;
}

static void *allocate(void) { return calloc(1, sizeof(allowance)); }

/* Absolute errors are set by the component; GSL's parameters for y and its rate are 1 and 0 here. */
static int initialize(void *state, double atol, double rtol, double of_y, double of_rate)
{
    (void)atol;
    (void)of_y;
    (void)of_rate;
    ((allowance *)state)->rtol = rtol;
    return GSL_SUCCESS;
}

static const gsl_odeiv2_control_type control_type = {"bounded", allocate, initialize, hadjust, errlevel, set_driver, free};

/* ---------------------------------------------------------------- msbdf */

struct linkdyn_gsl_ode {
    caller caller;
    gsl_odeiv2_system system;
    gsl_odeiv2_driver *driver;
    unsigned long rejected_before;    /* the last reset */
    double *kept;                     /* y before a step */
    double *atol, *largest;           /* errors allowed */
};

/* The driver with our control in the place of its own. */
static int take_control(linkdyn_gsl_ode *ode, double rtol)
{
    gsl_odeiv2_control *control = gsl_odeiv2_control_alloc(&control_type);
    if (!control) return GSL_ENOMEM;
    gsl_odeiv2_control_init(control, 0.0, rtol, 1.0, 0.0);
    ((allowance *)control->state)->atol = ode->atol;
    ((allowance *)control->state)->largest = ode->largest;
    gsl_odeiv2_control_free(ode->driver->c);
    ode->driver->c = control;
    return gsl_odeiv2_step_set_driver(ode->driver->s, ode->driver);
}

linkdyn_gsl_ode *linkdyn_gsl_ode_new(size_t n, linkdyn_ode_rates rates, linkdyn_ode_jacobian jacobian, void *context,
                                     double first_step, double rtol, const double *largest)
{
    linkdyn_gsl_ode *ode = calloc(1, sizeof *ode);
    if (!ode) return NULL;
    ode->caller = (caller){rates, jacobian, context};
    ode->system = (gsl_odeiv2_system){call_rates, call_jacobian, n, &ode->caller};
    ode->kept = malloc(n * sizeof *ode->kept);
    ode->atol = calloc(n, sizeof *ode->atol);
    ode->largest = malloc(n * sizeof *ode->largest);
    gsl_error_handler_t *before = gsl_set_error_handler_off();
    ode->driver = gsl_odeiv2_driver_alloc_y_new(&ode->system, gsl_odeiv2_step_msbdf, first_step, 0.0, rtol);
    int is_complete = ode->kept && ode->atol && ode->largest && ode->driver;
    if (is_complete) {
        memcpy(ode->largest, largest, n * sizeof *largest);
        is_complete = take_control(ode, rtol) == GSL_SUCCESS;
    }
    gsl_set_error_handler(before);
    if (is_complete) return ode;
    linkdyn_gsl_ode_free(ode);
    return NULL;
}

int linkdyn_gsl_ode_step(linkdyn_gsl_ode *ode, double *t, double t_end, double *h, double *y, const double *atol)
{
    gsl_odeiv2_driver *d = ode->driver;
    double t_before = *t;
    size_t bytes = ode->system.dimension * sizeof *y;
    memcpy(ode->kept, y, bytes);
    memcpy(ode->atol, atol, bytes);
    gsl_error_handler_t *before = gsl_set_error_handler_off();
    int code = gsl_odeiv2_evolve_apply(d->e, d->c, d->s, d->sys, t, t_end, h, y);
    gsl_set_error_handler(before);
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
    free(ode->atol);
    free(ode->largest);
    free(ode);
}
