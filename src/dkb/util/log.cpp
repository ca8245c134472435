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

}  // namespace dkb
