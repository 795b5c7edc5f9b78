// TOML glue: the only file that includes toml++.
#include "linkdyn_toml.h"

#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <memory>
#include <new>
#include <sstream>
#include <string>
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

// Lines count on from one file of a scene to the next. toml++ has a name of the file at every node: here it is the number
// of lines before the file's first, none for zero.
int lines_before(const toml::source_region &source) { return source.path ? std::atoi(source.path->c_str()) : 0; }

int line_of(const toml::source_region &source) {
    return source.begin.line ? lines_before(source) + static_cast<int>(source.begin.line) : 0;
}

// toml++ keeps keys sorted; users meet their keys in the order in which they wrote them.
std::vector<const toml::key *> keys_as_written(const toml::table &table) {
    std::vector<const toml::key *> keys;
    keys.reserve(table.size());
    for (auto it = table.cbegin(); it != table.cend(); ++it) keys.push_back(&it->first);
    std::stable_sort(keys.begin(), keys.end(), [](const toml::key *a, const toml::key *b) {
        const int line_a = line_of(a->source()), line_b = line_of(b->source());
        return line_a != line_b ? line_a < line_b : a->source().begin < b->source().begin;
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

template <class Value>
int put_value_at(const void *handle, int64_t index, Value value) {
    auto *array = const_cast<toml::array *>(handle ? as_node(handle)->as_array() : nullptr);
    if (!array || index < 0 || index >= static_cast<int64_t>(array->size())) return 0;
    try {
        array->replace(array->cbegin() + index, value);
    } catch (const std::bad_alloc &) {
        return 0;
    }
    return 1;
}

// A number in place of another: whole ones as integers, which are read wherever a float is, and for branches alone.
template <class Put>
int put_number(double value, Put put) {
    constexpr double largest = 9007199254740992.0;    // 2^53: doubles up to here tell all integers apart
    const bool is_whole = std::abs(value) <= largest && std::trunc(value) == value && !(value == 0 && std::signbit(value));
    return is_whole ? put(static_cast<int64_t>(value)) : put(value);
}

// ---- reading

// Tables in tables are taken down one inside the other: a key of very many parts would take the process with it.
constexpr int most_parts = 10000;

// The line in which a key has too many parts; 0: none has.
int line_of_deep_key(std::string_view text) {
    int line = 1, dots = 0;
    char until = 0;    // end of a string or comment
    for (const char letter : text) {
        if (letter == '\n') ++line;
        if (until != 0) {
            if (letter == until || letter == '\n') until = 0;
        } else if (letter == '"' || letter == '\'') {
            until = letter;
        } else if (letter == '#') {
            until = '\n';
        } else if (letter == '.') {
            if (++dots > most_parts) return line;
        } else if (std::string_view("\n=,[]{}").find(letter) != std::string_view::npos) {
            dots = 0;
        }
    }
    return 0;
}

// ---- joining

struct clash {
    std::string key;
    const toml::node *first = nullptr, *second = nullptr;
};

// Tables are merged, arrays of tables appended; anything else may stand in one of them only.
bool join(toml::table &into, toml::table &from, const std::string &above, clash &found) {
    for (auto &&[key, node] : from) {
        const std::string name = above + std::string(key.str());
        toml::node *there = into.get(key.str());
        if (!there) {
            const toml::key &named = key;
            node.visit([&](auto &value) { into.insert(named, std::move(value)); });
        } else if (there->is_table() && node.is_table()) {
            if (!join(*there->as_table(), *node.as_table(), name + ".", found)) return false;
        } else if (there->is_array_of_tables() && node.is_array_of_tables()) {
            for (auto &item : *node.as_array()) there->as_array()->push_back(std::move(*item.as_table()));
        } else {
            found = {name, there, &node};
            return false;
        }
    }
    return true;
}

// Names of files start at the folder of the file that has them: put that folder in front.
void move_files(toml::node &node, const std::string &folder) {
    if (auto *table = node.as_table()) {
        for (auto &&[key, value] : *table) {
            auto *text = value.as_string();
            if (text && (key.str() == "table" || key.str() == "mesh")) {
                if (text->get().rfind('/', 0) != 0) text->get() = folder + text->get();
            } else if (!text) {
                move_files(value, folder);
            }
        }
    } else if (auto *array = node.as_array()) {
        for (auto &item : *array) move_files(item, folder);
    }
}

// ---- writing

void write_text(std::ostream &out, std::string_view text) {
    // Without the forms over several lines, which a key or an inline table cannot have.
    out << toml::toml_formatter(toml::value<std::string>(text), toml::format_flags::none);
}

void write_key(std::ostream &out, std::string_view key) {
    const bool is_bare = !key.empty() && std::all_of(key.begin(), key.end(), [](char letter) {
        return (letter >= 'a' && letter <= 'z') || (letter >= 'A' && letter <= 'Z') || (letter >= '0' && letter <= '9') ||
               letter == '_' || letter == '-';
    });
    if (is_bare) out << key;
    else write_text(out, key);
}

void write_value(std::ostream &out, const toml::node &node) {
    if (const auto *table = node.as_table()) {
        const char *before = "{ ";
        for (const toml::key *key : keys_as_written(*table)) {
            out << before;
            write_key(out, key->str());
            out << " = ";
            write_value(out, *table->get(key->str()));
            before = ", ";
        }
        out << (table->empty() ? "{}" : " }");
    } else if (const auto *array = node.as_array()) {
        out << '[';
        for (size_t i = 0; i < array->size(); ++i) {
            if (i > 0) out << ", ";
            write_value(out, (*array)[i]);
        }
        out << ']';
    } else if (const auto *text = node.as_string()) {
        write_text(out, text->get());
    } else {
        node.visit([&](const auto &value) {
            if constexpr (toml::is_value<decltype(value)>) out << value;
        });
    }
}

void write_keys(std::ostream &out, const toml::table &table) {
    for (const toml::key *key : keys_as_written(table)) {
        write_key(out, key->str());
        out << " = ";
        write_value(out, *table.get(key->str()));
        out << '\n';
    }
}

// A document as a scene file is usually written: values, then tables, one level deep.
void write_document(std::ostream &out, const toml::table &root) {
    const auto keys = keys_as_written(root);
    for (const toml::key *key : keys) {
        const toml::node &node = *root.get(key->str());
        if (node.is_table() || node.is_array_of_tables()) continue;
        write_key(out, key->str());
        out << " = ";
        write_value(out, node);
        out << '\n';
    }
    for (const toml::key *key : keys) {
        const toml::node &node = *root.get(key->str());
        const bool is_list = node.is_array_of_tables();
        const auto write_table = [&](const toml::table &table) {
            out << (is_list ? "\n[[" : "\n[");
            write_key(out, key->str());
            out << (is_list ? "]]\n" : "]\n");
            write_keys(out, table);
        };
        if (node.is_table()) write_table(*node.as_table());
        if (!is_list) continue;
        for (const auto &item : *node.as_array()) write_table(*item.as_table());
    }
}

}  // namespace

extern "C" {

void *linkdyn_toml_parse(const char *text, int64_t text_len, int before, char *message, int message_len,
                         int *line, int *column) {
    *line = 0;
    *column = 0;
    try {
        const std::string_view all(text, static_cast<size_t>(text_len));
        if ((*line = line_of_deep_key(all)) > 0) {
            *column = 1;
            copy_text("a key of too many parts", message, message_len);
            return nullptr;
        }
        return new document{before > 0 ? toml::parse(all, std::to_string(before)) : toml::parse(all)};
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
    return handle ? line_of(as_node(handle)->source()) : 0;
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
        *line = line_of(found->source());
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
    return put_number(value, [&](auto number) {
        return put_value(handle, std::string_view(key, static_cast<size_t>(key_len)), number);
    });
}

int linkdyn_toml_put_text(const void *handle, const char *key, int key_len, const char *text, int64_t text_len) {
    return put_value(handle, std::string_view(key, static_cast<size_t>(key_len)),
                     std::string_view(text, static_cast<size_t>(text_len)));
}

int linkdyn_toml_put_at(const void *handle, int64_t index, double value) {
    return put_number(value, [&](auto number) { return put_value_at(handle, index, number); });
}

int linkdyn_toml_put_text_at(const void *handle, int64_t index, const char *text, int64_t text_len) {
    return put_value_at(handle, index, std::string_view(text, static_cast<size_t>(text_len)));
}

void linkdyn_toml_take_out(void *handle, const char *key, int key_len) {
    static_cast<document *>(handle)->root.erase(std::string_view(key, static_cast<size_t>(key_len)));
}

int linkdyn_toml_move_files(void *handle, const char *folder, int folder_len) {
    try {
        const std::string name(folder, static_cast<size_t>(folder_len));
        for (auto &&[key, node] : static_cast<document *>(handle)->root)
            if (key.str() != "variables") move_files(node, name);
    } catch (const std::bad_alloc &) {
        return 0;
    }
    return 1;
}

int linkdyn_toml_join(void *handle, void *other, char *key, int key_len, int *first_line, int *second_line) {
    try {
        clash found;
        if (join(static_cast<document *>(handle)->root, static_cast<document *>(other)->root, "", found)) return 1;
        copy_text(found.key, key, key_len);
        *first_line = linkdyn_toml_line(found.first);
        *second_line = linkdyn_toml_line(found.second);
    } catch (const std::bad_alloc &) {
        copy_text("(no memory)", key, key_len);
    }
    return 0;
}

int linkdyn_toml_write(const void *handle, char **text, int64_t *text_len) {
    *text = nullptr;
    *text_len = 0;
    try {
        std::ostringstream out;
        write_document(out, static_cast<const document *>(handle)->root);
        const std::string written = out.str();
        *text = static_cast<char *>(std::malloc(written.size() + 1));
        if (!*text) return 0;
        std::memcpy(*text, written.data(), written.size());
        *text_len = static_cast<int64_t>(written.size());
    } catch (const std::bad_alloc &) {
        return 0;
    }
    return 1;
}

}  // extern "C"
