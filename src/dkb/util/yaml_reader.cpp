// SPDX-License-Identifier: Apache-2.0
#include "dkb/util/yaml_reader.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "dkb/util/errors.h"
#include "dkb/util/one_line.h"
#include "dkb/util/plural.h"

namespace dkb {
namespace {

constexpr size_t kMaxBytes = size_t{1} << 20;  // such a file is a page, not a data set

// An empty value has the place of what follows it, if any.
int line_of(const YAML::Node& node, int otherwise) {
  return node.IsNull() ? otherwise : node.Mark().line + 1;
}

bool holds(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

}  // namespace

YamlReader::YamlReader(const YAML::Node& node, std::string file, std::string key, int line)
    : node_(std::make_shared<YAML::Node>(node)), file_(std::move(file)), key_(std::move(key)), line_(line) {}

YamlReader::YamlReader(const std::string& text, const std::string& file) : file_(file) {
  if (text.size() > kMaxBytes) fail("is too large; at most 1 MiB is read");
  if (text.find('\0') != std::string::npos) fail("is not a text file");
  try {
    node_ = std::make_shared<YAML::Node>(YAML::Load(text));
  } catch (const YAML::Exception& e) {
    line_ = e.mark.line + 1;
    fail("is not valid YAML (" + excerpt(e.msg) + ")");
  }
  if (!node_->IsMap()) line_ = line_of(*node_, 1);
}

std::string YamlReader::where() const {
  return line_ == 0 ? file_ : file_ + ":" + std::to_string(line_);
}

void YamlReader::fail(const std::string& what) const {
  throw InputError(where() + ": " + (key_.empty() ? "" : excerpt(key_) + ": ") + what);
}

bool YamlReader::empty() const {
  return node_->IsNull();
}
bool YamlReader::is_text() const {
  return node_->IsScalar();
}
bool YamlReader::is_list() const {
  return node_->IsSequence();
}

std::string YamlReader::text() const {
  if (!is_text()) fail("must be a text");
  return node_->Scalar();
}

double YamlReader::number(const Range& range) const {
  double value = 0;
  if (!is_text()) fail("must be a number");
  if (!parse_number(text(), &value) || !std::isfinite(value)) fail(in_quotes(text()) + " is not a number");
  if (!range.contains(value)) fail(excerpt(text()) + " is out of range; it must be " + range.text());
  return value;
}

int64_t YamlReader::whole(const Range& range) const {
  const double value = number();
  if (value != std::floor(value)) fail(in_quotes(text()) + " is not a whole number");
  return static_cast<int64_t>(number(range));
}

std::vector<YamlReader> YamlReader::list(size_t at_least) const {
  if (!is_list()) fail("must be a list, e.g. [a, b]");
  if (node_->size() < at_least) fail("must be a list of at least " + plural(at_least, "entry", "entries"));
  std::vector<YamlReader> all;
  for (const auto& entry : *node_) all.push_back(YamlReader(entry, file_, key_, line_of(entry, line_)));
  return all;
}

std::vector<std::pair<std::string, YamlReader>> YamlReader::items() const {
  if (!node_->IsMap()) fail("must be lines of the form `key: value`");
  std::vector<std::pair<std::string, YamlReader>> all;
  std::set<std::string> seen;
  for (const auto& item : *node_) {
    const YamlReader at(item.first, file_, key_, line_of(item.first, line_));
    if (!at.is_text()) at.fail("a key must be a word");
    const std::string name = at.text();
    all.emplace_back(name, YamlReader(item.second, file_, key_of(name), at.line_));
    if (!seen.insert(name).second) all.back().second.fail("is given twice; leave one out");
  }
  return all;
}

void YamlReader::check_keys(const std::vector<std::string>& known) const {
  const std::string possible = "; the keys are " + listed(known);
  if (!node_->IsMap()) fail("must be lines of the form `key: value`" + possible);
  for (const auto& [name, value] : items())
    if (!holds(known, name))
      throw InputError(value.where() + ": unknown key " + in_quotes(value.key_) + did_you_mean(name, known) + possible);
}

std::optional<YamlReader> YamlReader::find(const std::string& name) const {
  if (node_->IsMap())
    for (const auto& item : *node_)
      if (item.first.IsScalar() && item.first.Scalar() == name)
        return YamlReader(item.second, file_, key_of(name), line_of(item.first, line_));
  return std::nullopt;
}

YamlReader YamlReader::at(const std::string& name, const std::string& remedy) const {
  if (std::optional<YamlReader> value = find(name)) return *std::move(value);
  throw InputError(where() + ": key " + in_quotes(key_of(name)) + " is missing" + remedy);
}

void YamlReader::read(const std::string& name, std::string* field, const std::vector<std::string>& names) const {
  const std::optional<YamlReader> value = find(name);
  if (!value) return;
  *field = value->text();
  if (!names.empty() && !holds(names, *field))
    value->fail(in_quotes(*field) + " is not one of " + listed(names) + did_you_mean(*field, names));
}

void YamlReader::read(const std::string& name, double* field, const Range& range) const {
  if (const auto value = find(name)) *field = value->number(range);
}

void YamlReader::read(const std::string& name, int* field, const Range& range) const {
  if (const auto value = find(name)) *field = static_cast<int>(value->whole(range));
}

void YamlReader::read(const std::string& name, int64_t* field, const Range& range) const {
  if (const auto value = find(name)) *field = value->whole(range);
}

void YamlReader::read(const std::string& name, bool* field) const {
  const auto value = find(name);
  if (value && !YAML::convert<bool>::decode(*value->node_, *field)) value->fail("must be true or false");
}

}  // namespace dkb
