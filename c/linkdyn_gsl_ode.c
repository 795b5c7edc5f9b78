#include "linkdyn_gsl_ode.h"

#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>
#include <stdlib.h>
#include <string.h>

struct linkdyn_gsl_ode {
    gsl_odeiv2_system system;
    gsl_odeiv2_driver *driver;
    linkdyn_ode_rates rates;
    linkdyn_ode_jacobian jacobian;
    void *context;
    unsigned long rejected_before;    /* the last reset */
    double *kept;                     /* y before a step */
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
    ode->kept = malloc(n * sizeof *ode->kept);
    /* GSL's default error handler ends the program. */
    gsl_error_handler_t *before = gsl_set_error_handler_off();
    ode->driver = gsl_odeiv2_driver_alloc_y_new(&ode->system, type, first_step, atol, rtol);
    gsl_set_error_handler(before);
    if (ode->kept && ode->driver) return ode;
    linkdyn_gsl_ode_free(ode);
    return NULL;
}

int linkdyn_gsl_ode_step(linkdyn_gsl_ode *ode, double *t, double t_end, double *h, double *y)
{
    gsl_odeiv2_driver *d = ode->driver;
    double t_before = *t;
    size_t bytes = ode->system.dimension * sizeof *y;
    memcpy(ode->kept, y, bytes);
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
    free(ode);
}
