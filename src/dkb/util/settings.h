// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace dkb {

// The candidate with the smallest edit distance (Levenshtein) to `name`, the first of equals; empty when none is near
// enough to be a plausible misspelling (more than a third of the longer name, or 2 letters, differ).
std::string nearest_name(std::string_view name, const std::vector<std::string>& candidates);

// ` (did you mean "features.count"?)`, or nothing when no candidate is near.
std::string did_you_mean(std::string_view name, const std::vector<std::string>& candidates);

// Strict numbers, independent of the locale: the whole of `text`, no spaces, nothing after the number.
bool parse_number(std::string_view text, int64_t* value);
bool parse_number(std::string_view text, double* value);  // accepts nan and inf, as strtod does

// One setting as it stands.
struct SettingEntry {
  std::string key;    // dotted, e.g. "features.count"
  std::string value;  // as written by to_yaml()
  std::string doc;    // unit in brackets and meaning, e.g. "[px] border without features"
  std::string where;  // where it was set ("--set", "file.yaml:7"); empty = default
};

// Gives names to the fields of options structs, so that the command line and YAML files can set them. The structs stay
// the owners: a bound field must outlive the Settings, and its value when bound is the default. Range checks are the
// structs' own check().
class Settings {
 public:
  Settings() = default;
  Settings(const Settings&) = delete;
  Settings& operator=(const Settings&) = delete;

  // Throws std::logic_error when `key` is taken, or is the section of another key.
  void bind(const std::string& key, bool* field, const std::string& doc);
  void bind(const std::string& key, int* field, const std::string& doc);
  void bind(const std::string& key, int64_t* field, const std::string& doc);
  void bind(const std::string& key, uint64_t* field, const std::string& doc);
  void bind(const std::string& key, float* field, const std::string& doc);
  void bind(const std::string& key, double* field, const std::string& doc);
  void bind(const std::string& key, std::string* field, const std::string& doc);
  // An enum set by name. Names must be distinct and cover the field's value.
  template <class Enum>
  void bind(const std::string& key, Enum* field, const std::vector<std::pair<std::string, Enum>>& names,
            const std::string& doc);

  // `where` opens the messages: "--set", "preset.yaml:7". Throws InputError for an unknown key (with the nearest valid
  // one) and for a value of another type.
  void set(const std::string& key, const std::string& value, const std::string& where);
  // "key=value", as given to --set.
  void set_assignment(const std::string& assignment, const std::string& where);
  // Nested maps and dotted keys may be mixed; a key may occur once. Throws InputError with file:line.
  void load_yaml(const std::filesystem::path& path);
  void load_yaml_text(const std::string& text, const std::string& name);

  // Every setting with its effective value, sorted by key, nested, doc as comment. Loading it gives the same values.
  std::string to_yaml() const;
  std::vector<SettingEntry> entries() const;  // sorted by key
  std::vector<std::string> keys() const;      // sorted
  // Where the key was last set; empty while it has its default. Throws std::logic_error for a key never bound.
  std::string where(const std::string& key) const;

 private:
  struct Binding {
    std::string doc, where;
    std::string expected;                          // "a whole number", for messages
    std::function<bool(const std::string&)> read;  // false: not of this type; the field is unchanged then
    std::function<std::string()> write;
  };
  void add(const std::string& key, Binding binding);

  std::map<std::string, Binding> bindings_;
};

template <class Enum>
void Settings::bind(const std::string& key, Enum* field, const std::vector<std::pair<std::string, Enum>>& names,
                    const std::string& doc) {
  Binding b;
  b.doc = doc;
  b.expected = "one of";
  for (size_t i = 0; i < names.size(); ++i) b.expected += (i == 0 ? " " : ", ") + names[i].first;
  b.read = [field, names](const std::string& text) {
    for (const auto& [name, value] : names)
      if (name == text) {
        *field = value;
        return true;
      }
    return false;
  };
  b.write = [field, names, key] {
    for (const auto& [name, value] : names)
      if (value == *field) return name;
    throw std::logic_error(key + ": its value has no name");
  };
  add(key, std::move(b));
}

}  // namespace dkb
