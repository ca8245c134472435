// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "run_session.h"

namespace dkb {

// What a run was made by, and of: `run` of stats.json, as JSON. `camera`: the one that was chosen.
std::string run_json(const RunArguments& args, const Options& options, const Camera& camera);

}  // namespace dkb
