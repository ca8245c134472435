// SPDX-License-Identifier: Apache-2.0
#include "dkb/util/log.h"

namespace dkb {

void WarningLog::warn(const std::string& kind, const std::string& message) {
  std::unique_lock lock(mutex_);
  if (++counts_[kind] == 1 && sink_) sink_("warning: " + message);
}

void WarningLog::finish() {
  std::unique_lock lock(mutex_);
  for (const auto& [kind, count] : counts_)
    if (count > 1 && sink_) sink_("warning: " + kind + ": " + std::to_string(count) + " times in all");
}

size_t WarningLog::count(const std::string& kind) const {
  std::unique_lock lock(mutex_);
  const auto it = counts_.find(kind);
  return it == counts_.end() ? 0 : it->second;
}

}  // namespace dkb
