/* Signals: what a program of our own does on them, and how a guest in another program hears of Ctrl-C. */
#ifndef LINKDYN_INTERRUPT_H
#define LINKDYN_INTERRUPT_H

/* A file beyond the allowed size is a write error like any other. */
void linkdyn_settle_signals(void);

/* Remove this file if a signal ends the process; length 0 ends the watch. Signals ignored so far stay ignored. */
void linkdyn_guard_file(const char *path, int path_len);

/* End this program, started by us, too; 0: there is none. */
void linkdyn_guard_child(int process);

/* From now on the first SIGINT or SIGTERM is only noted; a second one ends the program. */
void linkdyn_watch_interrupts(void);

/* For a call from a host program: note its SIGINT as well, and pass it on. Heard in the main thread only, where the
 * host's own handler waits for the call to end. */
void linkdyn_start_listening(void);
void linkdyn_stop_listening(void);

/* Number of the signal noted; 0: none. */
int linkdyn_noted_interrupt(void);

#endif
