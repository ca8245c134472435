// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <mutex>
#include <string>

namespace dkb {

// Where warnings go. Repeated warnings of one kind are merged: the first is passed on, the rest are counted and
// summed up by finish(). Safe to call from any thread. The library never prints by itself.
class WarningLog {
 public:
  using Sink = std::function<void(const std::string& line)>;
  explicit WarningLog(Sink sink = {}) : sink_(std::move(sink)) {}

  void warn(const std::string& kind, const std::string& message);
  // Passes on one line for each kind that came more than once.
  void finish();

 private:
  Sink sink_;
  std::mutex mutex_;
  std::map<std::string, size_t> counts_;
};

}  // namespace dkb
