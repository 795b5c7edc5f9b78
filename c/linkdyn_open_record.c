/* What each thread has for itself: the record that it is writing. */
static _Thread_local void *open_record;

void *linkdyn_current_record(void) { return open_record; }

void linkdyn_set_current_record(void *record) { open_record = record; }
