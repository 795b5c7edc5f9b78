/* GSL's steppers behind plain C: the only door to gsl_odeiv2. */
#ifndef LINKDYN_GSL_ODE_H
#define LINKDYN_GSL_ODE_H

#include <stddef.h>

/* Right-hand side and Jacobian (row by row, then df/dt); nonzero: cannot be evaluated there. */
typedef int (*linkdyn_ode_rates)(double t, const double y[], double rate[], void *context);
typedef int (*linkdyn_ode_jacobian)(double t, const double y[], double *jacobian, double dfdt[], void *context);

/* ---- explicit Runge-Kutta methods, step by step; the control of the steps is the caller's */

typedef struct linkdyn_gsl_stepper linkdyn_gsl_stepper;

/* A stepper of GSL by its name (rkf45, rk8pd); NULL if there is none such, or no memory. */
linkdyn_gsl_stepper *linkdyn_gsl_stepper_new(const char *name, size_t n, linkdyn_ode_rates rates, void *context);

/* Order of the method, by which steps follow errors. */
unsigned linkdyn_gsl_stepper_order(const linkdyn_gsl_stepper *stepper);

/* A step from y, which becomes the solution at t + h; rate: at y. 0: done; otherwise GSL's code. */
int linkdyn_gsl_stepper_step(linkdyn_gsl_stepper *stepper, double t, double h, double *y, double *error,
                             const double *rate);

void linkdyn_gsl_stepper_free(linkdyn_gsl_stepper *stepper);

/* ---- the multistep method msbdf, which controls its steps itself */

typedef struct linkdyn_gsl_ode linkdyn_gsl_ode;

/* largest: what |y| counts at most where errors are relative; negative: any error is allowed. NULL if there is no
   memory. */
linkdyn_gsl_ode *linkdyn_gsl_ode_new(size_t n, linkdyn_ode_rates rates, linkdyn_ode_jacobian jacobian, void *context,
                                     double first_step, double rtol, const double *largest);

/* One accepted step from *t towards t_end, never beyond; *h in: to try, out: proposed next; atol: absolute error of each
   component that is allowed. 0: done; otherwise GSL's code, y and *t as before. */
int linkdyn_gsl_ode_step(linkdyn_gsl_ode *ode, double *t, double t_end, double *h, double *y, const double *atol);

/* Forget the history: the right-hand side has a kink here. */
int linkdyn_gsl_ode_reset(linkdyn_gsl_ode *ode);

/* Steps rejected so far. */
unsigned long linkdyn_gsl_ode_rejected(const linkdyn_gsl_ode *ode);

void linkdyn_gsl_ode_free(linkdyn_gsl_ode *ode);

#endif
