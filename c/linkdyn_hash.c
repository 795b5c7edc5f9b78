#include "linkdyn_hash.h"

/* SplitMix64's finalizer: every bit of the input moves about half of the output's. */
static uint64_t mix(uint64_t z)
{
    z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
    return z ^ (z >> 31);
}

static const uint64_t golden = UINT64_C(0x9E3779B97F4A7C15);

uint64_t linkdyn_counter_bits(uint64_t seed, uint64_t stream, uint64_t counter)
{
    uint64_t key = mix(mix(seed + golden) + (stream + 1) * golden);
    return mix(key + (counter + 1) * golden);
}

/* FNV-1a, then mixed so that short texts spread too. */
uint64_t linkdyn_hash_bytes(uint64_t hash, const char *bytes, int64_t n)
{
    hash ^= UINT64_C(0xCBF29CE484222325);
    for (int64_t i = 0; i < n; i++) {
        hash = (hash ^ (unsigned char)bytes[i]) * UINT64_C(0x100000001B3);
    }
    return mix(hash);
}
