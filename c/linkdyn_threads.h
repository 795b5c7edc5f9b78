/* How many threads a team may have. */
#ifndef LINKDYN_THREADS_H
#define LINKDYN_THREADS_H

/* As many as wanted, as there are tasks, and as the machine has a use for. In a process forked from one that had a team: 1. */
int linkdyn_team_size(int wanted, int n_task);

#endif
