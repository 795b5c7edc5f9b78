/* A sign of life on the terminal while a program computes: a timer of the system writes it, whatever the program is at. */
#ifndef LINKDYN_PROGRESS_LINE_H
#define LINKDYN_PROGRESS_LINE_H

/* After two seconds, and every half second from then on, a line on standard error. */
void linkdyn_start_sign(void);

/* What it says from now on, beside the seconds so far. */
void linkdyn_set_sign(const char *text, int text_len);

/* Wipe the line, and be silent. */
void linkdyn_end_sign(void);

#endif
