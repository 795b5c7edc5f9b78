// TOML glue: the only file that includes toml++.
#include "linkdyn_toml.h"

#include <toml++/toml.h>

#include <algorithm>
#include <cstring>
#include <exception>
#include <new>
#include <string_view>
#include <utility>
#include <vector>

namespace {

struct document {
    toml::table root;
};

const toml::node *as_node(const void *handle) { return static_cast<const toml::node *>(handle); }

int copy_text(std::string_view from, char *to, int64_t to_len) {
    const auto n = std::min<int64_t>(static_cast<int64_t>(from.size()), to_len);
    if (n > 0) std::memcpy(to, from.data(), static_cast<size_t>(n));
    if (to_len > n) std::memset(to + n, ' ', static_cast<size_t>(to_len - n));
    return static_cast<int>(from.size());
}

// toml++ keeps keys sorted; users meet their keys in the order in which they wrote them.
std::vector<const toml::key *> keys_as_written(const toml::table &table) {
    std::vector<const toml::key *> keys;
    keys.reserve(table.size());
    for (auto it = table.cbegin(); it != table.cend(); ++it) keys.push_back(&it->first);
    std::stable_sort(keys.begin(), keys.end(), [](const toml::key *a, const toml::key *b) {
        return a->source().begin < b->source().begin;
    });
    return keys;
}

// The document is the caller's own; nodes are handed out const because nothing else changes it.
template <class Value>
int put_value(const void *handle, std::string_view key, Value value) {
    auto *table = const_cast<toml::table *>(handle ? as_node(handle)->as_table() : nullptr);
    if (!table || !table->contains(key)) return 0;
    try {
        table->insert_or_assign(key, value);
    } catch (const std::bad_alloc &) {
        return 0;
    }
    return 1;
}

}  // namespace

extern "C" {

void *linkdyn_toml_parse(const char *text, int64_t text_len, char *message, int message_len,
                         int *line, int *column) {
    *line = 0;
    *column = 0;
    try {
        return new document{toml::parse(std::string_view(text, static_cast<size_t>(text_len)))};
    } catch (const toml::parse_error &error) {
        copy_text(error.description(), message, message_len);
        *line = static_cast<int>(error.source().begin.line);
        *column = static_cast<int>(error.source().begin.column);
    } catch (const std::exception &error) {
        copy_text(error.what(), message, message_len);
    } catch (...) {
        copy_text("unknown error", message, message_len);
    }
    return nullptr;
}

void linkdyn_toml_free(void *handle) { delete static_cast<document *>(handle); }

const void *linkdyn_toml_root(const void *handle) {
    const toml::node *root = &static_cast<const document *>(handle)->root;
    return root;
}

int linkdyn_toml_kind_of(const void *handle) {
    if (!handle) return linkdyn_toml_absent;
    switch (as_node(handle)->type()) {
        case toml::node_type::string: return linkdyn_toml_string;
        case toml::node_type::integer: return linkdyn_toml_integer;
        case toml::node_type::floating_point: return linkdyn_toml_float;
        case toml::node_type::boolean: return linkdyn_toml_boolean;
        case toml::node_type::table: return linkdyn_toml_table;
        case toml::node_type::array: return linkdyn_toml_array;
        case toml::node_type::none: return linkdyn_toml_absent;
        default: return linkdyn_toml_date;
    }
}

int linkdyn_toml_line(const void *handle) {
    return handle ? static_cast<int>(as_node(handle)->source().begin.line) : 0;
}

int64_t linkdyn_toml_size(const void *handle) {
    if (!handle) return 0;
    if (const auto *table = as_node(handle)->as_table()) return static_cast<int64_t>(table->size());
    if (const auto *array = as_node(handle)->as_array()) return static_cast<int64_t>(array->size());
    return 0;
}

const void *linkdyn_toml_at(const void *handle, int64_t index) {
    if (!handle) return nullptr;
    const auto *array = as_node(handle)->as_array();
    if (!array || index < 0 || index >= static_cast<int64_t>(array->size())) return nullptr;
    return array->get(static_cast<size_t>(index));
}

const void *linkdyn_toml_get(const void *handle, const char *key, int key_len) {
    if (!handle) return nullptr;
    const auto *table = as_node(handle)->as_table();
    if (!table) return nullptr;
    return table->get(std::string_view(key, static_cast<size_t>(key_len)));
}

int linkdyn_toml_key(const void *handle, int64_t index, char *key, int key_len, int *line) {
    *line = 0;
    if (!handle) return -1;
    const auto *table = as_node(handle)->as_table();
    if (!table || index < 0 || index >= static_cast<int64_t>(table->size())) return -1;
    try {
        const toml::key *found = keys_as_written(*table)[static_cast<size_t>(index)];
        *line = static_cast<int>(found->source().begin.line);
        return copy_text(found->str(), key, key_len);
    } catch (const std::bad_alloc &) {
        return -1;
    }
}

int linkdyn_toml_double(const void *handle, double *value) {
    if (!handle) return 0;
    if (const auto *number = as_node(handle)->as_floating_point()) {
        *value = number->get();
        return 1;
    }
    if (const auto *number = as_node(handle)->as_integer()) {
        *value = static_cast<double>(number->get());
        return 1;
    }
    return 0;
}

int linkdyn_toml_int64(const void *handle, int64_t *value) {
    if (!handle) return 0;
    const auto *number = as_node(handle)->as_integer();
    if (!number) return 0;
    *value = number->get();
    return 1;
}

int linkdyn_toml_bool(const void *handle, int *value) {
    if (!handle) return 0;
    const auto *flag = as_node(handle)->as_boolean();
    if (!flag) return 0;
    *value = flag->get() ? 1 : 0;
    return 1;
}

int64_t linkdyn_toml_text(const void *handle, char *text, int64_t text_len) {
    if (!handle) return -1;
    const auto *string = as_node(handle)->as_string();
    if (!string) return -1;
    return copy_text(string->get(), text, text_len);
}

int linkdyn_toml_put(const void *handle, const char *key, int key_len, double value) {
    return put_value(handle, std::string_view(key, static_cast<size_t>(key_len)), value);
}

int linkdyn_toml_put_text(const void *handle, const char *key, int key_len, const char *text, int64_t text_len) {
    return put_value(handle, std::string_view(key, static_cast<size_t>(key_len)),
                     std::string_view(text, static_cast<size_t>(text_len)));
}

int linkdyn_toml_put_at(const void *handle, int64_t index, double value) {
    auto *array = const_cast<toml::array *>(handle ? as_node(handle)->as_array() : nullptr);
    if (!array || index < 0 || index >= static_cast<int64_t>(array->size())) return 0;
    try {
        array->replace(array->cbegin() + index, value);
    } catch (const std::bad_alloc &) {
        return 0;
    }
    return 1;
}

}  // extern "C"
