/* Which machine code: what the user asks for, as far as the processor runs it. */
#include "linkdyn_code_choice.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const names[] = {"interpreter", "scalar", "avx2", "avx512"};
enum { N_SET = sizeof names/sizeof names[0], UNKNOWN = -1 };

/* What the processor runs best. */
static enum code_set best_set(void)
{
#if defined(__x86_64__)
    __builtin_cpu_init();
    if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) return CODE_INTERPRETER;
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl")) return CODE_AVX512;
    return CODE_AVX2;
#else
    return CODE_INTERPRETER;
#endif
}

static int number_of(const char *name)
{
    for (int i = 0; i < N_SET; i++)
        if (strcmp(name, names[i]) == 0) return i;
    return UNKNOWN;
}

/* A name of none of the sets is refused before anything is computed (linkdyn_code_is_known). */
static int wish(void)
{
    const char *name = getenv("LINKDYN_CODE");
    const int number = name && *name ? number_of(name) : N_SET - 1;
    return number == UNKNOWN ? CODE_INTERPRETER : number;
}

int linkdyn_code_is_known(void)
{
    const char *name = getenv("LINKDYN_CODE");
    return !name || !*name || number_of(name) != UNKNOWN;
}

enum code_set linkdyn_code_set(int can_fuse, int one)
{
    const int best = best_set(), wished = wish();
    if (!can_fuse || !linkdyn_emit_is_there() || best == CODE_INTERPRETER || wished == CODE_INTERPRETER) return CODE_INTERPRETER;
    if (one) return CODE_SCALAR;
    return wished < best ? wished : best;
}

/* ---------------------------------------------------------------- what is told */

static char refusal[EMIT_REASON];
static int has_refusal;         /* 0: none; 1: being written; 2: there */

void linkdyn_code_refused(const char *reason)
{
    int none = 0;
    if (!__atomic_compare_exchange_n(&has_refusal, &none, 1, 0, __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE)) return;
    snprintf(refusal, sizeof refusal, "%s", reason);
    __atomic_store_n(&has_refusal, 2, __ATOMIC_RELEASE);
}
