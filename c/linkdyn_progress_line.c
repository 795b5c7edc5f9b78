#define _XOPEN_SOURCE 700
#include "linkdyn_progress_line.h"

#include <errno.h>
#include <signal.h>
#include <stdatomic.h>
#include <string.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

enum { line_width = 76, text_capacity = 60, first_second = 2, refresh_microseconds = 500000 };

/* The handler may come at any instruction: a text is written where it does not look, then shown. */
static char texts[2][text_capacity];
static volatile sig_atomic_t shown_text = 0;
static volatile sig_atomic_t is_on = 0;
static volatile sig_atomic_t is_shown = 0;
static struct timespec start;

static size_t put_text(char *line, size_t at, const char *text)
{
    size_t length = strnlen(text, text_capacity);

    memcpy(line + at, text, length);
    return at + length;
}

static size_t put_number(char *line, size_t at, long number)
{
    char digits[24];
    size_t n = 0;

    do {
        digits[n++] = (char)('0' + number % 10);
        number /= 10;
    } while (number > 0);
    while (n > 0) {
        line[at++] = digits[--n];
    }
    return at;
}

/* Nothing but what a signal handler may call. */
static void show(int signal_number)
{
    char line[2 * line_width];
    struct timespec now;
    int code = errno;
    size_t at = 0;

    (void)signal_number;
    if (!is_on || clock_gettime(CLOCK_MONOTONIC, &now) != 0) {
        return;
    }
    memset(line, ' ', sizeof line);
    line[at++] = '\r';
    at = put_text(line, at + 2, texts[shown_text]);
    at = put_text(line, at, ", ");
    at = put_number(line, at, (long)(now.tv_sec - start.tv_sec));
    put_text(line, at, " s so far");
    is_shown = 1;
    if (write(STDERR_FILENO, line, line_width) < 0) {
        is_on = 0;    /* the terminal is gone */
    }
    errno = code;
}

void linkdyn_start_sign(void)
{
    struct sigaction action;
    struct itimerval timer = {{0, refresh_microseconds}, {first_second, 0}};

    memset(&action, 0, sizeof action);
    action.sa_handler = show;
    action.sa_flags = SA_RESTART;
    sigemptyset(&action.sa_mask);
    clock_gettime(CLOCK_MONOTONIC, &start);
    strcpy(texts[shown_text], "at work");
    if (sigaction(SIGALRM, &action, NULL) == 0 && setitimer(ITIMER_REAL, &timer, NULL) == 0) {
        is_on = 1;
    }
}

void linkdyn_set_sign(const char *text, int text_len)
{
    char *next = texts[1 - shown_text];
    size_t length = text_len < text_capacity ? (size_t)text_len : text_capacity;

    if (!is_on) {
        return;
    }
    memset(next, 0, text_capacity);
    memcpy(next, text, length);
    atomic_signal_fence(memory_order_seq_cst);
    shown_text = 1 - shown_text;
}

void linkdyn_end_sign(void)
{
    struct itimerval never = {{0, 0}, {0, 0}};
    char line[line_width + 2];

    if (!is_on) {
        return;
    }
    is_on = 0;
    setitimer(ITIMER_REAL, &never, NULL);
    if (is_shown) {
        memset(line, ' ', sizeof line);
        line[0] = line[sizeof line - 1] = '\r';
        is_shown = write(STDERR_FILENO, line, sizeof line) < 0;
    }
}
