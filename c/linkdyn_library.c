#include "linkdyn_library.h"

#include <string.h>

enum { capacity = 512 };

static _Thread_local char message[capacity + 1];

void linkdyn_note_error(const char *text, size_t size)
{
    size_t n = size < capacity ? size : capacity;

    memcpy(message, text, n);
    message[n] = '\0';
}

const char *linkdyn_last_error(void)
{
    return message;
}

const char *linkdyn_version(void)
{
    return LINKDYN_VERSION;
}
