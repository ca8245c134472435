// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "dkb/keyframes/keyframe_policy.h"
#include "dkb_slam/options.h"

namespace dkb {

// Asks a rule of the user's.
class UserKeyframeDecider final : public KeyframeDecider {
 public:
  explicit UserKeyframeDecider(std::shared_ptr<KeyframePolicy> policy) : policy_(std::move(policy)) {
    policy_->reset();
  }
  KeyframeDecision decide(const KeyframeContext& context, const Map& map) override;

 private:
  std::shared_ptr<KeyframePolicy> policy_;
};

}  // namespace dkb
