// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dkb/util/settings.h"

namespace YAML {
class Node;
}

namespace dkb {

// A value of a YAML file that people write. Whatever is wrong with it is an InputError that names the file, the line,
// the whole key and what is possible: "scene.yaml:7: room.height: 12 is out of range; it must be 2 ... 10".
class YamlReader {
 public:
  // The file as a whole. Throws for text that is not YAML, holds a zero byte or has more than 1 MiB.
  YamlReader(const std::string& text, const std::string& file);

  const std::string& key() const { return key_; }  // dotted from the top; in a list, that of the list
  int line() const { return line_; }
  std::string where() const;  // "scene.yaml:7", without a line where the file as a whole is meant
  [[noreturn]] void fail(const std::string& what) const;

  bool empty() const;  // nothing stands behind the key
  bool is_text() const;
  bool is_list() const;

  std::string text() const;
  double number(const Range& range = {}) const;
  std::vector<YamlReader> list(size_t at_least = 0) const;
  // The values of a map with their keys, in the file's order. Each key may be given once.
  std::vector<std::pair<std::string, YamlReader>> items() const;

  // Refuses what is no map, and keys that are not among `known`.
  void check_keys(const std::vector<std::string>& known) const;
  bool has(const std::string& name) const { return find(name).has_value(); }
  // The value of a key that must be there. `remedy` ends the message when it is not.
  YamlReader at(const std::string& name, const std::string& remedy = "") const;
  // Sets the field to the value of the key, when it is there. A text may be anything, or one of `names`.
  void read(const std::string& name, std::string* field, const std::vector<std::string>& names = {}) const;
  void read(const std::string& name, double* field, const Range& range = {}) const;
  void read(const std::string& name, int* field, const Range& range) const;
  void read(const std::string& name, int64_t* field, const Range& range) const;
  void read(const std::string& name, bool* field) const;

 private:
  YamlReader(const YAML::Node& node, std::string file, std::string key, int line);
  std::string key_of(const std::string& name) const { return key_.empty() ? name : key_ + "." + name; }
  std::optional<YamlReader> find(const std::string& name) const;
  int64_t whole(const Range& range) const;

  std::shared_ptr<const YAML::Node> node_;
  std::string file_, key_;
  int line_ = 0;
};

}  // namespace dkb
