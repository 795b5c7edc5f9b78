#define _POSIX_C_SOURCE 200809L
#include "linkdyn_lock.h"

#include <pthread.h>

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_mutex_t making;               /* of texts and of records */
static pthread_once_t once = PTHREAD_ONCE_INIT;
static _Thread_local int held;               /* how often this thread holds `making` */
static _Thread_local int lendable;           /* how often when it said that it may be lent; 0: it has not */

void linkdyn_hold_lock(void)
{
    pthread_mutex_lock(&lock);
}

void linkdyn_release_lock(void)
{
    pthread_mutex_unlock(&lock);
}

static void make_recursive(void)
{
    pthread_mutexattr_t attributes;

    pthread_mutexattr_init(&attributes);
    pthread_mutexattr_settype(&attributes, PTHREAD_MUTEX_RECURSIVE);
    pthread_mutex_init(&making, &attributes);
    pthread_mutexattr_destroy(&attributes);
}

static void hold_making(void)
{
    pthread_once(&once, make_recursive);
    pthread_mutex_lock(&making);
    held++;
}

static void release_making(void)
{
    held--;
    if (held < lendable)
        lendable = 0;
    pthread_mutex_unlock(&making);
}

void linkdyn_hold_texts(void)
{
    hold_making();
}

void linkdyn_release_texts(void)
{
    release_making();
}

void linkdyn_hold_records(void)
{
    hold_making();
}

void linkdyn_release_records(void)
{
    release_making();
}

void linkdyn_hold_texts_to_lend(void)
{
    hold_making();
    if (held == 1)
        lendable = held;
}

int linkdyn_lend_texts(void)
{
    if (held != 1 || lendable != 1)
        return 0;
    release_making();
    return 1;
}

void linkdyn_take_texts_back(int lent)
{
    if (lent)
        linkdyn_hold_texts_to_lend();
}
