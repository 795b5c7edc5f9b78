/* Which machine code: what the user asks for, as far as the processor runs it. */
#include "linkdyn_code_choice.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const names[] = {"interpreter", "scalar", "avx2", "avx512"};
enum { N_SET = sizeof names/sizeof names[0], UNKNOWN = -1 };

enum code_set linkdyn_best_set(void)
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

static int number_of(const char *name, size_t length)
{
    for (int i = 0; i < N_SET; i++)
        if (strlen(names[i]) == length && memcmp(name, names[i], length) == 0) return i;
    return UNKNOWN;
}

/* What the program has chosen; until then the environment is asked. */
static int chosen = UNKNOWN;

static int wish(void)
{
    const int number = __atomic_load_n(&chosen, __ATOMIC_RELAXED);
    if (number != UNKNOWN) return number;
    const char *name = getenv("LINKDYN_CODE");
    return name && *name ? number_of(name, strlen(name)) : N_SET - 1;
}

int linkdyn_choose_code(const char *name, int length)
{
    const int number = number_of(name, length);
    if (length > 0 && number == UNKNOWN) return 0;
    __atomic_store_n(&chosen, number, __ATOMIC_RELAXED);
    return 1;
}

int linkdyn_code_is_known(void) { return wish() != UNKNOWN; }

enum code_set linkdyn_code_set(int can_fuse, int one)
{
    const int best = linkdyn_best_set(), wished = wish();
    if (!can_fuse || !linkdyn_emit_is_there() || best == CODE_INTERPRETER || wished <= CODE_INTERPRETER) return CODE_INTERPRETER;
    if (one) return CODE_SCALAR;
    return wished < best ? wished : best;
}

/* ---------------------------------------------------------------- what is told */

static char refusal[EMIT_REASON];
static int refusal_state;       /* 0: none; 1: being written; 2: there */

void linkdyn_code_refused(const char *reason)
{
    int none = 0;
    if (!__atomic_compare_exchange_n(&refusal_state, &none, 1, 0, __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE)) return;
    snprintf(refusal, sizeof refusal, "%s", reason);
    __atomic_store_n(&refusal_state, 2, __ATOMIC_RELEASE);
}

static const char *why_interpreted(int can_fuse)
{
    if (wish() == CODE_INTERPRETER) return NULL;
    if (!linkdyn_emit_is_there()) return "this build has no encoder of machine code";
    if (!can_fuse || linkdyn_best_set() == CODE_INTERPRETER) return "no machine code for this processor";
    return __atomic_load_n(&refusal_state, __ATOMIC_ACQUIRE) == 2 ? refusal : NULL;
}

void linkdyn_describe_code(int can_fuse, char *text, int room)
{
    char line[160];
    const char *why = why_interpreted(can_fuse);
    if (why) snprintf(line, sizeof line, "%s (%s)", names[CODE_INTERPRETER], why);
    else snprintf(line, sizeof line, "%s", names[linkdyn_code_set(can_fuse, 0)]);
    const int length = (int)strlen(line);
    for (int i = 0; i < room; i++) text[i] = i < length ? line[i] : ' ';
}
