/* No encoder: the interpreter runs. Twin of linkdyn_emit.cpp. */
#include "linkdyn_emit.h"

#include <stdio.h>

int linkdyn_emit_is_there(void) { return 0; }
int linkdyn_emit_width(enum code_set set) { (void)set; return 1; }
int linkdyn_emit_registers(enum code_set set) { (void)set; return 15; }

struct emitter *linkdyn_emit_open(enum code_set set, int lanes, int columns, size_t n_step, size_t n_function, const struct lane_functions *functions)
{
    (void)set, (void)lanes, (void)columns, (void)n_step, (void)n_function, (void)functions;
    return NULL;
}

size_t linkdyn_emit_begin(struct emitter *e) { (void)e; return 0; }
void linkdyn_emit_step(struct emitter *e, const struct emit_step *step) { (void)e, (void)step; }
void linkdyn_emit_end(struct emitter *e) { (void)e; }

const char *linkdyn_emit_close(struct emitter *e, char reason[EMIT_REASON])
{
    (void)e;
    snprintf(reason, EMIT_REASON, "built without an encoder");
    return NULL;
}

void linkdyn_emit_free(struct emitter *e) { (void)e; }
