// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dkb_slam/options.h"

namespace dkb {

// The candidate with the smallest edit distance to `name`, neighbours that changed places being one edit; empty when
// none is near enough to be a plausible misspelling (more than a third of the longer name differs, or more than one
// letter of a short one) or several are as near.
std::string nearest_name(std::string_view name, const std::vector<std::string>& candidates);

// ` (did you mean "features.count"?)`, or nothing when no candidate is near.
std::string did_you_mean(std::string_view name, const std::vector<std::string>& candidates);

// "a, b, c".
std::string listed(const std::vector<std::string>& names);

// Strict numbers, independent of the locale: the whole of `text`, no spaces, nothing after the number.
bool parse_number(std::string_view text, int64_t* value);
bool parse_number(std::string_view text, double* value);  // accepts nan and inf, as strtod does

// The numbers that a setting may take.
struct Range {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool above_min = false;  // min itself is out
  bool contains(double value) const {
    return (above_min ? value > min : value >= min) && value <= max && std::isfinite(value);
  }
  std::string text() const;  // "at least 1", "0 ... 1"; empty for all numbers
};

// One setting as it stands.
struct SettingEntry {
  std::string key;      // dotted, e.g. "features.count"
  std::string value;    // as written by to_yaml()
  std::string doc;      // unit in brackets and meaning, e.g. "[px] border without features"
  std::string where;    // where it was set ("--set", "file.yaml:7"); empty = default
  std::string initial;  // the value when it was bound
  std::string range;    // what it may be: "0.5 ... 20", "true, false", "red, green"; may be empty
  SettingKind kind = SettingKind::number;
  Range limits;                      // of a number
  std::vector<std::string> choices;  // of a name
  std::string unit() const;          // of its doc
  std::string meaning() const;       // its doc without the unit
};

// The values of an enum as text.
template <class Enum>
using Names = std::vector<std::pair<std::string, Enum>>;

// One line of a settings file, with the place it comes from ("file.yaml:7").
struct SettingLine {
  std::string key, value, where;
};

// Key and value of "key=value". Throws InputError beginning with `where`.
std::pair<std::string, std::string> split_assignment(const std::string& assignment, const std::string& where);

// Lines of YAML, sections nested, doc as comment. The entries must be sorted by key.
std::string settings_yaml(const std::vector<SettingEntry>& entries);

// Gives names to the fields of options structs, so that the command line and YAML files can set them. The structs stay
// the owners: a bound field must outlive the Settings, and its value when bound is the default.
class Settings {
 public:
  Settings() = default;
  Settings(const Settings&) = delete;
  Settings& operator=(const Settings&) = delete;

  // Throws std::logic_error when `key` is taken, or is the section of another key.
  void bind(const std::string& key, bool* field, const std::string& doc);
  void bind(const std::string& key, int* field, const std::string& doc, const Range& range = {});
  void bind(const std::string& key, uint64_t* field, const std::string& doc);
  void bind(const std::string& key, double* field, const std::string& doc, const Range& range = {});
  // An enum set by name. Names must be distinct and cover the field's value.
  template <class Enum>
  void bind(const std::string& key, Enum* field, const std::string& doc, const Names<Enum>& names);

  // `where` opens the messages: "--set", "preset.yaml:7". Throws InputError for an unknown key (with the nearest valid
  // one) and for a value of another type, InvalidOption for one out of range; the field keeps its value then.
  void set(const std::string& key, const std::string& value, const std::string& where);
  // Nested maps and dotted keys may be mixed; a key may occur once. Throws InputError with file:line.
  void load_yaml_text(const std::string& text, const std::string& name);
  // The lines of such a text, in its order, with keys and values still to be judged by set().
  std::vector<SettingLine> parse_yaml(const std::string& text, const std::string& name) const;
  // Throws InvalidOption for the first field that is out of range.
  void check() const;

  // Every setting with its effective value, sorted by key, nested, doc as comment. Loading it gives the same values.
  std::string to_yaml() const;
  std::vector<SettingEntry> entries() const;  // sorted by key
  std::vector<std::string> keys() const;      // sorted
  bool has(const std::string& key) const { return bindings_.contains(key); }
  bool has_section(const std::string& name) const;
  // Where the key was last set; empty while it has its default. Throws std::logic_error for a key never bound.
  std::string where(const std::string& key) const;

 private:
  struct Binding {
    std::string doc;
    std::string expected;                          // "a whole number", for messages
    std::string range;                             // of its values, in words
    std::function<bool(const std::string&)> read;  // false: not of this type; the field is unchanged then
    std::function<std::string()> write;
    std::function<bool()> in_range;
    SettingKind kind = SettingKind::number;
    Range limits = {};
    std::vector<std::string> choices = {};
    std::string where = "", initial = "";
  };
  void add(const std::string& key, Binding binding);
  template <class Number>
  void bind_number(const std::string& key, Number* field, const std::string& doc, const Range& range);

  std::map<std::string, Binding> bindings_;
};

template <class Enum>
void Settings::bind(const std::string& key, Enum* field, const std::string& doc, const Names<Enum>& names) {
  Binding b;
  b.doc = doc;
  b.kind = SettingKind::name;
  for (const auto& [name, value] : names) {
    b.range += (b.range.empty() ? "" : ", ") + name;
    b.choices.push_back(name);
  }
  b.expected = "one of " + b.range;
  b.read = [field, names](const std::string& text) {
    for (const auto& [name, value] : names)
      if (name == text) {
        *field = value;
        return true;
      }
    return false;
  };
  b.write = [field, names] {
    for (const auto& [name, value] : names)
      if (value == *field) return name;
    return std::to_string(static_cast<int>(*field));
  };
  b.in_range = [field, names] {
    return std::any_of(names.begin(), names.end(), [field](const auto& n) { return n.second == *field; });
  };
  add(key, std::move(b));
}

}  // namespace dkb
