// SPDX-License-Identifier: Apache-2.0
#include "dkb/util/settings.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <type_traits>
#include <utility>

#include "dkb/util/errors.h"
#include "dkb/util/one_line.h"
#include "dkb/util/yaml_reader.h"

namespace dkb {
namespace {

// Letters that are left out, added or replaced, and neighbours that changed places.
size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<size_t> before(b.size() + 1), row(b.size() + 1), next(b.size() + 1);
  for (size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (size_t i = 1; i <= a.size(); ++i) {
    next[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      next[j] = std::min({row[j] + 1, next[j - 1] + 1, row[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        next[j] = std::min(next[j], before[j - 2] + 1);
    }
    before.swap(row);
    row.swap(next);
  }
  return row[b.size()];
}

// The shortest text that reads back as the same number.
template <class T>
std::string number_to_text(T value) {
  char buffer[64];
  const auto end = std::to_chars(buffer, buffer + sizeof buffer, value).ptr;
  return std::string(buffer, end);
}

// A limit in digits: 100000, not 1e+05.
std::string limit_to_text(double value) {
  return std::abs(value) < 1e15 && value == std::floor(value) ? number_to_text(static_cast<int64_t>(value))
                                                              : number_to_text(value);
}

}  // namespace

std::string nearest_name(std::string_view name, const std::vector<std::string>& candidates) {
  std::string best;
  size_t best_distance = std::numeric_limits<size_t>::max();
  bool one_of_several = false;
  if (name.size() > 200) return best;
  for (const std::string& candidate : candidates) {
    const size_t distance = edit_distance(name, candidate);
    const size_t longer = std::max(name.size(), candidate.size());
    const size_t shorter = std::min(name.size(), candidate.size());
    const bool plausible = distance <= std::max<size_t>(1, longer / 3) && distance < shorter;
    if (!plausible || distance > best_distance) continue;
    one_of_several = distance == best_distance && candidate != best;
    best = candidate, best_distance = distance;
  }
  return one_of_several ? "" : best;
}

std::string did_you_mean(std::string_view name, const std::vector<std::string>& candidates) {
  const std::string nearest = nearest_name(name, candidates);
  return nearest.empty() ? "" : " (did you mean \"" + nearest + "\"?)";
}

std::string listed(const std::vector<std::string>& names) {
  std::string all;
  for (const std::string& name : names) all += (all.empty() ? "" : ", ") + name;
  return all;
}

bool parse_number(std::string_view text, int64_t* value) {
  int64_t parsed = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), parsed);
  if (error != std::errc() || end != text.data() + text.size() || text.empty()) return false;
  *value = parsed;
  return true;
}

bool parse_number(std::string_view text, double* value) {
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
  double parsed = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), parsed);
  if (error != std::errc() || end != text.data() + text.size() || text.empty()) return false;
  *value = parsed;
  return true;
}

void Settings::add(const std::string& key, Binding binding) {
  if (key.empty()) throw std::logic_error("a setting needs a key");
  for (const auto& [other, unused] : bindings_) {
    const auto is_section = [](const std::string& section, const std::string& of) {
      return of.size() > section.size() && of.compare(0, section.size(), section) == 0 && of[section.size()] == '.';
    };
    if (other == key || is_section(other, key) || is_section(key, other))
      throw std::logic_error("setting " + key + " clashes with " + other);
  }
  binding.initial = binding.write();
  bindings_.emplace(key, std::move(binding));
}

namespace {

template <class Number>
bool read_number(const std::string& text, Number* field) {
  if constexpr (std::is_floating_point_v<Number>) {
    double parsed = 0;
    if (!parse_number(text, &parsed) || !std::isfinite(parsed)) return false;
    *field = parsed;
    return true;
  } else {
    Number parsed = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), parsed);
    if (error != std::errc() || end != text.data() + text.size() || text.empty()) return false;
    *field = parsed;
    return true;
  }
}

}  // namespace

std::string SettingEntry::unit() const {
  const std::string unit = doc.starts_with('[') ? doc.substr(1, doc.find(']') - 1) : "";
  return unit == "1" ? "" : unit;
}

std::string SettingEntry::meaning() const {
  return doc.starts_with('[') && doc.find("] ") != std::string::npos ? doc.substr(doc.find("] ") + 2) : doc;
}

std::string Range::text() const {
  if (std::isfinite(max))
    return above_min ? "above " + limit_to_text(min) + ", at most " + limit_to_text(max)
                     : limit_to_text(min) + " ... " + limit_to_text(max);
  if (!std::isfinite(min)) return "";
  return (above_min ? "above " : "at least ") + limit_to_text(min);
}

template <class Number>
void Settings::bind_number(const std::string& key, Number* field, const std::string& doc, const Range& range) {
  const char* type = std::is_floating_point_v<Number> ? "a number"
                     : std::is_signed_v<Number>       ? "a whole number"
                                                      : "a whole number, not negative";
  add(key, {doc, type, range.text(), [field](const std::string& text) { return read_number(text, field); },
            [field] { return number_to_text(*field); },
            [field, range] { return range.contains(static_cast<double>(*field)); },
            std::is_floating_point_v<Number> ? SettingKind::number : SettingKind::whole, range});
}

void Settings::bind(const std::string& key, int* field, const std::string& doc, const Range& range) {
  bind_number(key, field, doc, range);
}
void Settings::bind(const std::string& key, uint64_t* field, const std::string& doc) {
  bind_number(key, field, doc, {});
}
void Settings::bind(const std::string& key, double* field, const std::string& doc, const Range& range) {
  bind_number(key, field, doc, range);
}

void Settings::bind(const std::string& key, bool* field, const std::string& doc) {
  add(key, {doc, "true or false", "true, false",
            [field](const std::string& text) {
              if (text != "true" && text != "false") return false;
              *field = text == "true";
              return true;
            },
            [field] { return std::string(*field ? "true" : "false"); }, [] { return true; }, SettingKind::boolean});
}

void Settings::set(const std::string& key, const std::string& value, const std::string& where) {
  const auto it = bindings_.find(key);
  if (it == bindings_.end())
    throw InputError(where + ": unknown key \"" + excerpt(key) + "\"" + did_you_mean(key, keys()));
  Binding& b = it->second;
  const std::string before = b.write();
  if (!b.read(value)) throw InputError(where + ": " + key + ": \"" + excerpt(value) + "\" is not " + b.expected);
  if (!b.in_range()) {
    b.read(before);
    throw InvalidOption(where + ": " + key, excerpt(value), b.range);
  }
  b.where = where;
}

void Settings::check() const {
  for (const auto& [key, b] : bindings_)
    if (!b.in_range()) throw InvalidOption(key, b.write(), b.range);
}

std::pair<std::string, std::string> split_assignment(const std::string& assignment, const std::string& where) {
  const size_t equals = assignment.find('=');
  if (equals == std::string::npos)
    throw InputError(where + ": \"" + excerpt(assignment) + "\" has no value; write key=value");
  return {assignment.substr(0, equals), assignment.substr(equals + 1)};
}

void Settings::load_yaml_text(const std::string& text, const std::string& name) {
  for (const SettingLine& line : parse_yaml(text, name)) set(line.key, line.value, line.where);
}

std::vector<SettingLine> Settings::parse_yaml(const std::string& text, const std::string& name) const {
  std::vector<SettingLine> lines;
  // Every value that is entered has a key of its own that is a known one or a known section, so that aliases cannot
  // make the walk long.
  std::set<std::string> seen;
  const std::function<void(const YamlReader&)> walk = [&](const YamlReader& section) {
    if (section.empty()) return;  // with all its lines commented out
    for (const auto& [unused, value] : section.items()) {
      const std::string& key = value.key();
      if (!seen.insert(key).second) value.fail("is given twice; leave one out");
      if (has_section(key)) {
        walk(value);
      } else if (bindings_.count(key) != 0 && !value.is_text()) {
        value.fail("has no value; it must be " + bindings_.at(key).expected);
      } else {
        lines.push_back({key, value.is_text() ? value.text() : "", value.where()});
      }
    }
  };
  walk(YamlReader(text, name));
  return lines;
}

std::string Settings::to_yaml() const {
  return settings_yaml(entries());
}

std::string settings_yaml(const std::vector<SettingEntry>& entries) {
  std::string out;
  std::vector<std::string> open;  // sections of the line before
  for (const SettingEntry& entry : entries) {
    const std::string& key = entry.key;
    std::vector<std::string> parts;
    for (size_t start = 0;;) {
      const size_t dot = key.find('.', start);
      parts.push_back(key.substr(start, dot == std::string::npos ? dot : dot - start));
      if (dot == std::string::npos) break;
      start = dot + 1;
    }
    const std::string leaf = parts.back();
    parts.pop_back();
    size_t common = 0;
    while (common < open.size() && common < parts.size() && open[common] == parts[common]) ++common;
    for (size_t i = common; i < parts.size(); ++i) out += std::string(2 * i, ' ') + parts[i] + ":\n";
    open = parts;
    out += std::string(2 * parts.size(), ' ') + leaf + ": " + entry.value;
    if (!entry.doc.empty()) out += "  # " + entry.doc;
    out += "\n";
  }
  return out;
}

std::vector<SettingEntry> Settings::entries() const {
  std::vector<SettingEntry> result;
  for (const auto& [key, b] : bindings_)
    result.push_back({key, b.write(), b.doc, b.where, b.initial, b.range, b.kind, b.limits, b.choices});
  return result;
}

std::vector<std::string> Settings::keys() const {
  std::vector<std::string> result;
  for (const auto& [key, unused] : bindings_) result.push_back(key);
  return result;
}

bool Settings::has_section(const std::string& name) const {
  const auto at = bindings_.lower_bound(name + ".");
  return at != bindings_.end() && at->first.starts_with(name + ".");
}

std::string Settings::where(const std::string& key) const {
  const auto it = bindings_.find(key);
  if (it == bindings_.end()) throw std::logic_error("no setting " + key);
  return it->second.where;
}

}  // namespace dkb
