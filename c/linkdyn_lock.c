#define _POSIX_C_SOURCE 200809L
#include "linkdyn_lock.h"

#include <pthread.h>

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_mutex_t making;               /* of texts and of records */
static pthread_once_t once = PTHREAD_ONCE_INIT;

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

void linkdyn_hold_texts(void)
{
    pthread_once(&once, make_recursive);
    pthread_mutex_lock(&making);
}

void linkdyn_release_texts(void)
{
    pthread_mutex_unlock(&making);
}

void linkdyn_hold_records(void)
{
    pthread_once(&once, make_recursive);
    pthread_mutex_lock(&making);
}

void linkdyn_release_records(void)
{
    pthread_mutex_unlock(&making);
}
