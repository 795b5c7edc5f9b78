/* Which machine code kernels are made of, and why there is none. */
#ifndef LINKDYN_CODE_CHOICE_H
#define LINKDYN_CODE_CHOICE_H

#include "linkdyn_emit.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The best code that the processor runs. */
enum code_set linkdyn_best_set(void);

/* What LINKDYN_CODE = interpreter | scalar | avx2 | avx512 asks for, or the best that the processor runs. `can_fuse`: this
 * process works with multiply-adds, which all code has. */
enum code_set linkdyn_code_set(int can_fuse, int one);

/* Choose it for this process, whatever the environment says; an empty name takes the choice back. 0: there is no such code. */
int linkdyn_choose_code(const char *name, int length);
int linkdyn_code_is_known(void);

/* The code's name, and why kernels are interpreted if that was not asked for; blanks behind. */
void linkdyn_describe_code(int can_fuse, char *text, int room);

/* Some code could not be made. */
void linkdyn_code_refused(const char *reason);

#ifdef __cplusplus
}
#endif
#endif
