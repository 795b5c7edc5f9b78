/* Unsigned 64-bit arithmetic that wraps around, which Fortran does not have: counter-based random bits and hashes. */
#ifndef LINKDYN_MIX_H
#define LINKDYN_MIX_H

#include <stdint.h>

/* 64 random bits, a function of the three numbers alone: any part of a stream can be had without the rest. */
uint64_t linkdyn_counter_bits(uint64_t seed, uint64_t stream, uint64_t counter);

/* Bytes mixed into a hash, which starts anywhere. */
uint64_t linkdyn_hash_bytes(uint64_t hash, const char *bytes, int64_t n);

#endif
