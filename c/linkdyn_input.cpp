// Whole files and decimal numbers, for the Fortran readers.
#include "linkdyn_input.h"

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>
#include <string>

namespace {

void copy_message(const char *from, char *to, int to_len) {
    const int n = std::min(static_cast<int>(std::strlen(from)), to_len);
    std::memcpy(to, from, static_cast<size_t>(n));
    std::memset(to + n, ' ', static_cast<size_t>(to_len - n));
}

int outcome_of(int error, char *message, int message_len) {
    copy_message(std::strerror(error), message, message_len);
    switch (error) {
        case ENOENT:
        case ENOTDIR: return linkdyn_file_missing;
        case EISDIR: return linkdyn_file_directory;
        case EACCES:
        case EPERM: return linkdyn_file_denied;
        default: return linkdyn_file_failed;
    }
}

// What is read counts its characters with 32 bits. A device or pipe does not say how much will come, and may never end.
constexpr size_t most_of_file = 2147483647;
constexpr size_t most_of_stream = size_t{1} << 28;

// Grows by doubling; one spare byte keeps the block from being empty.
int read_all(std::FILE *file, size_t expected, size_t most, char **data, int64_t *size) {
    if (expected > most) return EFBIG;
    size_t capacity = expected + 1;
    size_t used = 0;
    char *buffer = static_cast<char *>(std::malloc(capacity));
    while (buffer) {
        used += std::fread(buffer + used, 1, capacity - used, file);
        if (std::ferror(file)) break;
        if (used > most) errno = EFBIG;
        if (used > most) break;
        if (used < capacity) {
            *data = buffer;
            *size = static_cast<int64_t>(used);
            return 0;
        }
        capacity = std::min(2 * capacity + 65536, most + 1);
        char *larger = static_cast<char *>(std::realloc(buffer, capacity));
        if (!larger) errno = ENOMEM;
        if (!larger) break;
        buffer = larger;
    }
    const int error = errno ? errno : EIO;
    std::free(buffer);
    return error;
}

}  // namespace

extern "C" {

int linkdyn_file_read(const char *path, int path_len, char **data, int64_t *size, char *message, int message_len) {
    *data = nullptr;
    *size = 0;
    try {
        const std::string name(path, static_cast<size_t>(path_len));
        struct stat info;
        if (stat(name.c_str(), &info) != 0) return outcome_of(errno, message, message_len);
        if (S_ISDIR(info.st_mode)) return outcome_of(EISDIR, message, message_len);
        std::FILE *file = std::fopen(name.c_str(), "rb");
        if (!file) return outcome_of(errno, message, message_len);
        const size_t expected = info.st_size > 0 ? static_cast<size_t>(info.st_size) : 0;
        const int error = read_all(file, expected, S_ISREG(info.st_mode) ? most_of_file : most_of_stream, data, size);
        std::fclose(file);
        return error ? outcome_of(error, message, message_len) : linkdyn_file_ok;
    } catch (const std::bad_alloc &) {
        return outcome_of(ENOMEM, message, message_len);
    }
}

void linkdyn_file_free(char *data) { std::free(data); }

void linkdyn_parse_number(const char *text, int text_len, double *value, int *used) {
    *value = 0;
    *used = 0;
    const char *first = text;
    const char *last = text + text_len;
    if (first != last && *first == '+') ++first;
    if (first != text && first != last && (*first == '+' || *first == '-')) return;
    const auto result = std::from_chars(first, last, *value);
    if (result.ec == std::errc::invalid_argument) return;
    if (result.ec == std::errc::result_out_of_range) {
        // from_chars leaves the value alone; strtod tells too small (0) from too large (infinite).
        char copy[512];
        const size_t n = std::min<size_t>(static_cast<size_t>(result.ptr - first), sizeof copy - 1);
        std::memcpy(copy, first, n);
        copy[n] = '\0';
        *value = std::strtod(copy, nullptr);
    }
    *used = static_cast<int>(result.ptr - text);
}

int linkdyn_format_number(double value, char *text, int text_len) {
    if (std::isnan(value)) {
        std::memcpy(text, "NaN", 3);
        return 3;
    }
    return static_cast<int>(std::to_chars(text, text + text_len, value).ptr - text);
}

}  // extern "C"
