/* Locks of the process, of OpenMP's threads and of any others. */
#ifndef LINKDYN_LOCK_H
#define LINKDYN_LOCK_H

/* For lists that several threads change: held for a few instructions, never twice by one thread. */
void linkdyn_hold_lock(void);
void linkdyn_release_lock(void);

/* For the making of texts, and for the making of records: one lock under two names, since whoever makes the one comes to make
   the other. A thread that holds it may hold it again. */
void linkdyn_hold_texts(void);
void linkdyn_release_texts(void);
void linkdyn_hold_records(void);
void linkdyn_release_records(void);

/* As `linkdyn_hold_texts`, by a thread that can do without the lock wherever, further down, long computing says so: between
   `lend`, which tells whether it was lent, and `take_back`, which wants to know that. */
void linkdyn_hold_texts_to_lend(void);
int linkdyn_lend_texts(void);
void linkdyn_take_texts_back(int lent);

#endif
