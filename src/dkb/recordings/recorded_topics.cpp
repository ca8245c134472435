// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/recorded_topics.h"

#include "dkb/util/one_line.h"

namespace dkb {

std::optional<size_t> RecordedTopics::add(std::string name, std::string type, MessageEncoding encoding) {
  if (name.size() > kLongestName || type.size() > kLongestName) return std::nullopt;
  if (const size_t layer = type.find("/msg/"); layer != std::string::npos) type.erase(layer, 4);
  if (type == "tf/tfMessage") type = "tf2_msgs/TFMessage";  // its older name
  const std::pair<std::string, std::string> both(name, type);
  if (const auto same = by_name_.find(both); same != by_name_.end())
    for (const size_t i : same->second)
      if (topics_[i].encoding == encoding) return i;
  if (topics_.size() >= kMost || text_size_ + name.size() + type.size() > kMostText) return std::nullopt;
  text_size_ += name.size() + type.size();
  by_name_[both].push_back(topics_.size());
  wanted_.push_back(!selected_ || selected_->count(name) > 0);
  topics_.push_back({std::move(name), std::move(type), encoding, std::nullopt});
  return topics_.size() - 1;
}

void RecordedTopics::add_count(size_t topic, int64_t count) {
  std::optional<int64_t>& sum = topics_[topic].count;
  sum = sum.value_or(0) + count;
}

void RecordedTopics::count_rest() {
  for (RecordedTopic& topic : topics_) topic.count = topic.count.value_or(0);
}

void RecordedTopics::forget_counts() {
  for (RecordedTopic& topic : topics_) topic.count.reset();
}

void RecordedTopics::select(const std::vector<std::string>& names) {
  selected_.emplace(names.begin(), names.end());
  for (size_t i = 0; i < topics_.size(); ++i) wanted_[i] = selected_->count(topics_[i].name) > 0;
}

void RecordingWarnings::add(std::string line) {
  constexpr int kMost = 10;
  if (++told_ > kMost) return;
  lines_.push_back(one_line(line) + (told_ == kMost ? "; further warnings of this recording are left out" : ""));
}

}  // namespace dkb
