/* Threads of the BLAS library. */
#ifndef LINKDYN_BLAS_H
#define LINKDYN_BLAS_H

/* One BLAS thread until as many calls of release as of hold; any other library than OpenBLAS is left alone. */
void linkdyn_hold_blas(void);
void linkdyn_release_blas(void);

#endif
