// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <set>
#include <string>
#include <utility>
#include <vector>

#include "dkb/recordings/message_stream.h"

namespace dkb {

// What every kind of recording keeps of its topics: which there are, and which are wanted.
class RecordedTopics {
 public:
  static constexpr size_t kMost = 65536;
  static constexpr size_t kLongestName = 1024;          // [bytes] of a topic or a type
  static constexpr size_t kMostText = size_t{1} << 24;  // [bytes] of all names together

  const std::vector<RecordedTopic>& all() const { return topics_; }
  // The same name, type and encoding is the same topic, however many wrote to it. Nothing when there are too many, and
  // for names that are too long.
  std::optional<size_t> add(std::string name, std::string type, MessageEncoding encoding);
  void add_count(size_t topic, int64_t count);
  void count_rest();  // an index that is whole names no messages of the others: they have none
  void forget_counts();
  void select(const std::vector<std::string>& names);
  bool wanted(size_t topic) const { return wanted_[topic]; }

 private:
  std::vector<RecordedTopic> topics_;
  std::vector<bool> wanted_;
  std::map<std::pair<std::string, std::string>, std::vector<size_t>> by_name_;
  std::optional<std::set<std::string>> selected_;
  size_t text_size_ = 0;
};

// A line each, the first few of them: a file that is broken all over says so briefly.
class RecordingWarnings {
 public:
  void add(std::string line);
  std::vector<std::string> take() { return std::exchange(lines_, {}); }

 private:
  std::vector<std::string> lines_;
  int told_ = 0;
};

}  // namespace dkb
